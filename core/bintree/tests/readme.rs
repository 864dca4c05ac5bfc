//! The README's code is the example's.

#[test]
fn the_sample_is_the_example() {
    let readme = include_str!("../README.md");
    let example = include_str!("../examples/own_primitives.rs");
    let (_, rest) = readme.split_once("```rust,ignore\n").expect("there is a sample");
    let (sample, _) = rest.split_once("```").expect("it ends");
    assert!(sample.lines().count() > 15);
    assert!(example.contains(sample), "examples/own_primitives.rs has changed; change README.md too");
}
