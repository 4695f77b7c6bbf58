use std::thread;

use super::*;

#[test]
fn a_mind_that_panicked_says_so_to_whichever_thread_calls() {
    let settings = br#"{"robot": 1, "boot": 1, "seed": 7, "vocabulary": ["left", "right"]}"#;
    let started = PortableMind::new(Settings::parse(settings).unwrap()).unwrap();
    let mut mind = Mind { mind: started, broken: None };
    // SAFETY: a living mind that nobody else uses.
    assert_eq!(unsafe { with(&raw mut mind, |_| panic!("the sky fell")) }, Status::Panicked);
    assert_eq!(last_error::get(), "gestalt panicked: the sky fell");
    for _ in 0..2 {
        let (status, said) = thread::scope(|threads| {
            let calls = threads.spawn(|| {
                // SAFETY: a living mind, and its thread waits for this one.
                let status = unsafe { gestalt_mind_tick(&raw mut mind, 0) };
                (status, last_error::get())
            });
            calls.join().unwrap()
        });
        assert_eq!(status, Status::Panicked);
        assert!(said.contains("the sky fell") && said.contains("start another"), "{said}");
    }
}
