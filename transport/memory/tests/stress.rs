//! Many threads at once: whole frames, in order from each sender, never more than there is room for, and lost last.

use hybray_link::{Event, Link, Peer};
use hybray_memory::{MemoryLink, ROOM, links};
use std::sync::atomic::{AtomicI64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

const PEERS: Peer = 6;
const FRAMES: u64 = 3_000;

/// A frame whose length and every byte follow from who sends it to whom, and its number.
fn frame(from: Peer, to: Peer, number: u64) -> Vec<u8> {
    let length = (number * 37 % 400) as usize + 12;
    let mut bytes = vec![(number ^ u64::from(from)) as u8; length];
    bytes[..2].copy_from_slice(&from.to_le_bytes());
    bytes[2..4].copy_from_slice(&to.to_le_bytes());
    bytes[4..12].copy_from_slice(&number.to_le_bytes());
    bytes
}

fn send(link: &mut MemoryLink, to: Peer, bytes: &[u8]) -> bool {
    link.send(to, bytes.len() + 9, &mut |room| {
        room[..bytes.len()].copy_from_slice(bytes);
        bytes.len()
    })
}

/// Everybody sends to everybody, themselves included, and leaves; with `sleep`, some read slowly.
fn everybody_talks(sleep: bool) {
    let waiting: Vec<AtomicI64> = (0..PEERS * PEERS).map(|_| AtomicI64::new(0)).collect();
    thread::scope(|scope| {
        for mut link in links(PEERS) {
            let waiting = &waiting;
            scope.spawn(move || {
                let me = link.me();
                let count = |from: Peer, to: Peer| &waiting[usize::from(from * PEERS + to)];
                let mut sent = [0u64; PEERS as usize];
                let mut heard = [0u64; PEERS as usize];
                let mut lost = [false; PEERS as usize];
                let mut turns = 0u64;
                while sent != [FRAMES; PEERS as usize] || !(0..usize::from(PEERS)).all(|peer| heard[peer] == FRAMES) {
                    let mut busy = false;
                    for to in 0..PEERS {
                        let next = &mut sent[usize::from(to)];
                        // Counted before it is sent: a reader may be quicker than the next line.
                        count(me, to).fetch_add(1, Ordering::SeqCst);
                        if *next < FRAMES && send(&mut link, to, &frame(me, to, *next)) {
                            *next += 1;
                            busy = true;
                            assert!(
                                count(me, to).load(Ordering::SeqCst) <= i64::from(ROOM) + 1,
                                "more than there is room for"
                            );
                        } else {
                            count(me, to).fetch_sub(1, Ordering::SeqCst);
                        }
                    }
                    busy |= link.receive(&mut |event| match event {
                        Event::Frame { from, bytes } => {
                            let number = &mut heard[usize::from(from)];
                            assert!(!lost[usize::from(from)], "a frame after the sender's end");
                            assert_eq!(bytes, frame(from, me, *number), "whole and in order");
                            *number += 1;
                            count(from, me).fetch_sub(1, Ordering::SeqCst);
                        }
                        Event::Lost { peer } => {
                            assert!(!lost[usize::from(peer)], "lost twice");
                            assert_eq!(heard[usize::from(peer)], FRAMES, "lost before its last frame");
                            lost[usize::from(peer)] = true;
                        }
                    });
                    turns += 1;
                    if sleep && me % 2 == 0 && turns.is_multiple_of(500) {
                        thread::sleep(Duration::from_micros(200));
                    }
                    if !busy {
                        link.wait(50_000_000);
                    }
                }
            });
        }
    });
}

#[test]
fn frames_arrive_whole_once_and_in_order() {
    everybody_talks(false);
}

#[test]
fn slow_readers_hold_back_those_who_write_to_them() {
    everybody_talks(true);
}

/// A sender that sleeps because there was no room must not sleep on when there is.
#[test]
fn room_ends_a_wait() {
    let mut ends = links(2);
    let (mut reader, mut writer) = (ends.pop().unwrap(), ends.pop().unwrap());
    while send(&mut writer, 1, b"x") {}
    let start = Instant::now();
    thread::scope(|scope| {
        scope.spawn(|| {
            thread::sleep(Duration::from_millis(20));
            assert!(reader.receive(&mut |_| {}));
        });
        while !send(&mut writer, 1, b"y") {
            writer.wait(60_000_000_000);
        }
    });
    assert!(start.elapsed() < Duration::from_secs(30), "slept through it: {:?}", start.elapsed());
    // What woke it is no event.
    assert!(!writer.receive(&mut |event| panic!("{event:?}")));
}

/// A thread that panics is lost to all others, after what it had sent.
#[test]
fn a_panic_is_a_loss_after_the_last_frame() {
    let mut ends = links(3).into_iter();
    let (mut a, mut b, mut c) = (ends.next().unwrap(), ends.next().unwrap(), ends.next().unwrap());
    let ended = thread::spawn(move || {
        (0..5).for_each(|i| assert!(send(&mut b, 0, &[i; 3])));
        // Not `panic!`, which would print.
        std::panic::resume_unwind(Box::new("on purpose"));
    });
    assert!(ended.join().is_err());
    for i in 0..5 {
        assert!(a.receive(&mut |event| assert_eq!(event, Event::Frame { from: 1, bytes: &[i; 3] })));
    }
    for end in [&mut a, &mut c] {
        assert!(end.receive(&mut |event| assert_eq!(event, Event::Lost { peer: 1 })));
        assert!(!end.receive(&mut |_| {}) && !send(end, 1, b"late"));
    }
}
