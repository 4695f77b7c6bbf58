//! The C interface as a caller sees it, in Rust: what Miri can follow (`make miri`), which runs no program in C.

use std::ffi::{CString, c_char};
use std::mem::MaybeUninit;
use std::ptr::{null, null_mut};

use gestalt_c::*;

const MS: u64 = 1_000_000;

/// A mind that is freed whatever happens.
struct Robot(*mut Mind);

impl Robot {
    fn new(id: u32) -> Self {
        let settings = format!(r#"{{"robot": {id}, "boot": 1, "seed": 7, "vocabulary": ["left", "right"]}}"#);
        let (settings, mut mind) = (CString::new(settings).unwrap(), null_mut());
        // SAFETY: a text that ends with a zero byte, and room for a pointer.
        assert_eq!(unsafe { gestalt_mind_new(settings.as_ptr(), &raw mut mind) }, Status::Ok);
        Self(mind)
    }

    /// All that it wants said, each first asked for with too little room.
    fn messages(&self) -> Vec<(CString, Vec<u8>, u32)> {
        let mut said = Vec::new();
        loop {
            let mut message = Message {
                key: null_mut(),
                key_capacity: 0,
                key_length: 0,
                payload: null_mut(),
                payload_capacity: 0,
                payload_length: 0,
                to: 0,
                json: false,
            };
            // SAFETY: a message whose buffers have room for nothing.
            match unsafe { gestalt_mind_next_message(self.0, &raw mut message) } {
                Status::Nothing => return said,
                status => assert_eq!(status, Status::TooSmall),
            }
            let mut key = vec![0_u8; message.key_length + 1];
            let mut payload = vec![0_u8; message.payload_length];
            message.key = key.as_mut_ptr().cast::<c_char>();
            message.payload = payload.as_mut_ptr();
            (message.key_capacity, message.payload_capacity) = (key.len(), payload.len());
            // SAFETY: as much room as it says.
            assert_eq!(unsafe { gestalt_mind_next_message(self.0, &raw mut message) }, Status::Ok);
            said.push((CString::from_vec_with_nul(key).unwrap(), payload, message.to));
        }
    }

    fn decision(&self) -> Option<String> {
        let (mut buffer, mut length) = (vec![0_u8; 16], 0);
        loop {
            let room = buffer.as_mut_ptr().cast();
            // SAFETY: as much room as it says, and a number.
            match unsafe { gestalt_mind_decision(self.0, room, buffer.len(), &raw mut length) } {
                Status::Nothing => return None,
                Status::TooSmall => buffer.resize(length + 1, 0),
                status => {
                    assert_eq!((status, buffer[length]), (Status::Ok, 0));
                    return Some(String::from_utf8(buffer[..length].to_vec()).unwrap());
                }
            }
        }
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        // SAFETY: it comes from `gestalt_mind_new`, and is dropped once.
        unsafe { gestalt_mind_free(self.0) };
    }
}

#[test]
fn two_minds_agree_through_the_c_interface_and_leave_nothing_behind() {
    let robots = [Robot::new(1), Robot::new(2)];
    for (robot, other) in robots.iter().zip([2_u32, 1]) {
        // SAFETY: living minds, and arrays as long as they say.
        unsafe {
            assert_eq!(gestalt_mind_set_alive(robot.0, 0, [1_u32, 2].as_ptr(), 2), Status::Ok);
            assert_eq!(gestalt_mind_set_neighbours(robot.0, 0, &raw const other, 1), Status::Ok);
        }
    }
    // SAFETY: a living mind.
    assert_eq!(unsafe { gestalt_mind_open(robots[0].0, MS) }, Status::Ok);
    for now in (2..2000).step_by(40).map(|ms| ms * MS) {
        for (n, robot) in robots.iter().enumerate() {
            // SAFETY: living minds, and arrays as long as they say.
            unsafe {
                if gestalt_mind_is_open(robot.0) == Status::Ok {
                    let seen = [0.2_f32, 0.8];
                    assert_eq!(gestalt_mind_observe(robot.0, now, seen.as_ptr(), 2, 1.0), Status::Ok);
                }
                if gestalt_mind_next_wake(robot.0) <= now {
                    assert_eq!(gestalt_mind_tick(robot.0, now), Status::Ok);
                }
            }
            for (key, payload, to) in robot.messages() {
                let other = &robots[1 - n];
                if to == GESTALT_TO_ALL || to as usize == 2 - n {
                    // SAFETY: a text that ends with a zero byte, and as many bytes as it says.
                    let status = unsafe {
                        gestalt_mind_received(other.0, now, key.as_ptr(), payload.as_ptr(), payload.len())
                    };
                    assert!(matches!(status, Status::Ok | Status::Nothing), "{status:?}");
                }
            }
        }
    }
    let held = robots.each_ref().map(|robot| robot.decision().expect("it decides"));
    assert!(held.iter().all(|held| held.contains("right")), "{held:?}");
}

#[test]
fn of_a_message_nothing_is_read_but_what_is_the_callers() {
    let robot = Robot::new(1);
    let mut message = MaybeUninit::<Message>::uninit();
    let out = message.as_mut_ptr();
    // SAFETY: a living mind, and a message whose buffers have room for nothing.
    unsafe {
        out.cast::<u8>().write_bytes(0xAA, size_of::<Message>());
        (&raw mut (*out).key).write(null_mut());
        (&raw mut (*out).key_capacity).write(0);
        (&raw mut (*out).payload).write(null_mut());
        (&raw mut (*out).payload_capacity).write(0);
        let json = (&raw mut (*out).json).cast::<u8>();
        assert_eq!(gestalt_mind_next_message(robot.0, out), Status::Nothing);
        assert_eq!(json.read(), 0xAA, "where nothing waits nothing is written");
        assert_eq!(gestalt_mind_open(robot.0, MS), Status::Ok);
        assert_eq!(gestalt_mind_tick(robot.0, 1000 * MS), Status::Ok);
        assert_eq!(gestalt_mind_next_message(robot.0, out), Status::TooSmall);
        assert_eq!(json.read(), 0, "a vote is no JSON");
    }
    // SAFETY: four of its fields were written above, the others by the call.
    let message = unsafe { message.assume_init() };
    assert!(message.key_length > 0 && message.payload_length > 0 && message.to == GESTALT_TO_ALL);
}

#[test]
fn what_is_no_argument_is_refused_and_nothing_is_read() {
    let robot = Robot::new(1);
    // SAFETY: null is allowed everywhere, and so are arrays that nobody may read.
    unsafe {
        assert_eq!(gestalt_mind_new(null(), null_mut()), Status::Argument);
        assert_eq!(gestalt_mind_tick(null_mut(), 0), Status::Argument);
        assert_eq!(gestalt_mind_next_wake(null_mut()), GESTALT_NEVER);
        assert_eq!(gestalt_mind_next_message(robot.0, null_mut()), Status::Argument);
        assert_eq!(gestalt_mind_observe(robot.0, 0, null(), 2, 1.0), Status::Argument);
        let bytes = [0_u8; 9];
        let misaligned =
            bytes.as_ptr().wrapping_add(1 + usize::from(bytes.as_ptr() as usize % 2 == 1)).cast();
        let seen = [f32::NAN, 1.0];
        assert_eq!(gestalt_mind_observe(robot.0, 0, seen.as_ptr(), 2, 1.0), Status::Argument);
        assert_eq!(gestalt_mind_observe(robot.0, 0, misaligned, 2, 1.0), Status::Argument);
        assert_eq!(gestalt_mind_observe(robot.0, 0, seen.as_ptr(), usize::MAX / 2, 1.0), Status::Argument);
        gestalt_mind_free(null_mut());
    }
}
