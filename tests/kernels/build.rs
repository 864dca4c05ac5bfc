//! Looks for Embree's header and compiles the adaptor where it is: then the program has the engine, else it does
//! without.

use std::path::Path;

/// Embree's major versions that the adaptor knows, the newest first.
const VERSIONS: [u32; 2] = [4, 3];

fn main() {
    println!("cargo::rerun-if-changed=src/embree.c");
    println!("cargo::rustc-check-cfg=cfg(has_embree)");
    let found = ["/usr/include", "/usr/local/include"].into_iter().find_map(|folder| {
        let has = |version: &u32| Path::new(folder).join(format!("embree{version}/rtcore.h")).is_file();
        VERSIONS.into_iter().find(has).map(|version| (folder, version))
    });
    let Some((folder, version)) = found else { return };
    println!("cargo::rerun-if-changed={folder}/embree{version}/rtcore.h");
    let mut build = cc::Build::new();
    build.file("src/embree.c").include(folder).define("EMBREE", version.to_string().as_str()).opt_level(3);
    match build.try_compile("hybray_embree") {
        Ok(()) => {
            println!("cargo::rustc-link-lib=embree{version}");
            println!("cargo::rustc-cfg=has_embree");
        }
        Err(error) => println!("cargo::warning=Embree {version} is left out: {error}"),
    }
}
