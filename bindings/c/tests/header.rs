//! The header that is checked in is the one that cbindgen makes.

use std::path::Path;

/// What makes it.
fn header() -> String {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(here.join("cbindgen.toml")).expect("cbindgen.toml");
    let sources = ["status.rs", "mind.rs", "last_error.rs"].map(|file| here.join("src").join(file));
    let builder = sources
        .iter()
        .fold(cbindgen::Builder::new().with_config(config), |builder, source| builder.with_src(source));
    let mut made = Vec::new();
    builder.generate().expect("cbindgen reads the sources").write(&mut made);
    String::from_utf8(made).expect("a header is text")
}

#[test]
fn the_header_checked_in_is_the_one_that_cbindgen_makes() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("include/gestalt.h");
    let made = header();
    if std::env::var_os("GESTALT_BLESS").is_some() {
        std::fs::write(&path, &made).expect("the header can be written");
    }
    let kept = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        kept == made,
        "run GESTALT_BLESS=1 cargo test -p gestalt-c --test header, and commit include/gestalt.h"
    );
}
