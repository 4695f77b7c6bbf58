//! The targets under libFuzzer: `GESTALT_FUZZ=<target> guided [its options] CORPUS`.
#![no_main]

use std::sync::LazyLock;

use gestalt_fuzz::Target;
use libfuzzer_sys::fuzz_target;

static TARGET: LazyLock<Target> = LazyLock::new(|| {
    let name = std::env::var("GESTALT_FUZZ").unwrap_or_default();
    name.parse().unwrap_or_else(|error| panic!("GESTALT_FUZZ: {error}"))
});

fuzz_target!(|bytes: &[u8]| {
    TARGET.run(bytes);
});
