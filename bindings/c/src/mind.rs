//! A mind behind an opaque pointer.
//!
//! All functions take null for the mind as an error. One mind is for one thread at a time; different minds are independent.

use std::ffi::c_char;
use std::fs::{self, File};
use std::io::Read;
use std::ptr::null_mut;
use std::time::Duration;

use gestalt_mind::{MAX_MODEL_FILE, PortableMind, Settings};

use crate::border::guarded;
use crate::last_error;
use crate::pointers::{slice, text, write_out};
use crate::refused::Refused;
use crate::status::Status;

/// What `gestalt_mind_next_wake` gives when the mind wants no tick.
pub const GESTALT_NEVER: u64 = u64::MAX;

/// To all robots: a message's `to`. No neighbour has this number.
pub const GESTALT_TO_ALL: u32 = u32::MAX;

/// The mind of one robot.
#[derive(Debug)]
pub struct Mind {
    mind: PortableMind,
    /// What a panic said, if it met one: what it holds may be half done.
    broken: Option<String>,
}

/// A message for the host to carry, in buffers of the caller: `key`, `key_capacity`, `payload` and `payload_capacity` are the
/// caller's, the rest is written.
#[repr(C)]
#[derive(Debug)]
pub struct Message {
    /// Where the key is written: `gestalt/<swarm>/…`, UTF-8 that ends with a zero byte.
    pub key: *mut c_char,
    /// How many bytes there is room for, the zero byte included.
    pub key_capacity: usize,
    /// How long the key is, without the zero byte.
    pub key_length: usize,
    /// Where the payload is written.
    pub payload: *mut u8,
    /// How many bytes there is room for.
    pub payload_capacity: usize,
    /// How long the payload is.
    pub payload_length: usize,
    /// The neighbour that it is for, or `GESTALT_TO_ALL`.
    pub to: u32,
    /// Whether the payload is JSON; else it is an envelope, which `gestalt_mind_received` also takes without a key.
    pub json: bool,
}

/// Calls into a mind that is there and whole.
///
/// # Safety
/// `mind` is null, or comes from `gestalt_mind_new`, was not freed, and is used by no other thread meanwhile.
unsafe fn with(mind: *mut Mind, call: impl FnOnce(&mut PortableMind) -> Result<Status, Refused>) -> Status {
    // SAFETY: null, or a pointer to a living mind that nobody else uses, as the caller promises.
    let Some(mind) = (unsafe { mind.as_mut() }) else {
        return guarded(|| Err(Refused::Argument("the mind is null".to_owned())));
    };
    if let Some(panic) = &mind.broken {
        // Whoever calls now may not be the thread that was told of the panic.
        last_error::set(format!(
            "an earlier call may have left this mind half changed: {panic}; free it, and start another"
        ));
        return Status::Panicked;
    }
    let status = guarded(|| call(&mut mind.mind));
    mind.broken = (status == Status::Panicked).then(last_error::get);
    status
}

fn done(result: Result<(), gestalt_mind::MindError>) -> Result<Status, Refused> {
    result.map(|()| Status::Ok).map_err(Refused::from)
}

/// Starts a mind. `settings` is JSON, such as
/// `{"robot": 1, "boot": 1, "seed": 42, "swarm": "demo", "vocabulary": ["left", "right"]}`; `bindings/README.md` lists all keys.
/// Writes the mind to `*mind`, or null if it cannot start. Free it with `gestalt_mind_free`.
///
/// # Safety
/// `settings` is null or ends with a zero byte; `mind` is null or has room for a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gestalt_mind_new(settings: *const c_char, mind: *mut *mut Mind) -> Status {
    guarded(|| {
        if mind.is_null() {
            return Err(Refused::Argument("there is no room for the mind: mind is null".to_owned()));
        }
        // SAFETY: it is not null, and the caller promises room for a pointer.
        unsafe { mind.write(null_mut()) };
        // SAFETY: the caller promises the zero byte.
        let settings = unsafe { text(settings, "settings") }?;
        let started = PortableMind::new(Settings::parse(settings.as_bytes())?)?;
        let started = Box::new(Mind { mind: started, broken: None });
        // SAFETY: as above.
        unsafe { mind.write(Box::into_raw(started)) };
        Ok(Status::Ok)
    })
}

/// Ends a mind; null is none.
///
/// # Safety
/// `mind` is null, or comes from `gestalt_mind_new`, was not freed before, and is used by no other thread.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gestalt_mind_free(mind: *mut Mind) {
    if !mind.is_null() {
        // SAFETY: it came from `Box::into_raw`, and the caller promises that nobody uses it any more.
        let mind = unsafe { Box::from_raw(mind) };
        guarded(move || {
            drop(mind);
            Ok(Status::Ok)
        });
    }
}

/// Reads a model file that `gestalt train` wrote. From now on the mind observes feature vectors. A mind that learns takes its
/// model before all else.
///
/// # Safety
/// `mind` as everywhere; `path` is null or ends with a zero byte.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gestalt_mind_load_model(
    mind: *mut Mind,
    now_ns: u64,
    path: *const c_char,
) -> Status {
    // SAFETY: the caller's promises are passed on.
    unsafe {
        with(mind, |mind| {
            let bytes = read_model(text(path, "path")?)?;
            done(mind.load_model(Duration::from_nanos(now_ns), &bytes))
        })
    }
}

fn read_model(path: &str) -> Result<Vec<u8>, Refused> {
    let failed = |error: std::io::Error| Refused::Io(format!("cannot read the model {path}: {error}"));
    // Opening a folder succeeds, and a pipe would never end.
    if !fs::metadata(path).map_err(failed)?.is_file() {
        return Err(Refused::Io(format!("cannot read the model {path}: it is not a regular file")));
    }
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(failed)?;
    file.take(MAX_MODEL_FILE + 1).read_to_end(&mut bytes).map_err(failed)?;
    Ok(bytes)
}

/// A frame showed a hand: `values` is its feature vector or, without a model, the probability of each gesture of the
/// vocabulary. `quality` is how far that is to be trusted, 0 to 1.
///
/// # Safety
/// `mind` as everywhere; `values` points to `length` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gestalt_mind_observe(
    mind: *mut Mind,
    now_ns: u64,
    values: *const f32,
    length: usize,
    quality: f32,
) -> Status {
    // SAFETY: the caller's promises are passed on.
    unsafe {
        with(mind, |mind| done(mind.observe(Duration::from_nanos(now_ns), slice(values, length)?, quality)))
    }
}

/// A message arrived, with the key that `gestalt_mind_next_message` gave it. For an envelope `key` may be null: it names its
/// author itself, and what was for another robot is for the host to leave out.
///
/// # Safety
/// `mind` as everywhere; `key` is null or ends with a zero byte; `payload` points to `length` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gestalt_mind_received(
    mind: *mut Mind,
    now_ns: u64,
    key: *const c_char,
    payload: *const u8,
    length: usize,
) -> Status {
    let now = Duration::from_nanos(now_ns);
    // SAFETY: the caller's promises are passed on.
    unsafe {
        with(mind, |mind| {
            let payload = slice(payload, length)?;
            done(match key.is_null() {
                true => mind.received_envelope(now, payload),
                false => mind.received(now, text(key, "key")?, payload),
            })
        })
    }
}

/// An instructor says something, as JSON: `{"say": "was", "round": {…}, "class": "left"}`. `at` is a time that is the same at
/// every robot, and grows with every word of that instructor.
///
/// # Safety
/// `mind` as everywhere; `instructor` and `word` are null or end with a zero byte.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gestalt_mind_instructed(
    mind: *mut Mind,
    now_ns: u64,
    instructor: *const c_char,
    at: u64,
    word: *const c_char,
) -> Status {
    // SAFETY: the caller's promises are passed on.
    unsafe {
        with(mind, |mind| {
            let (instructor, word) = (text(instructor, "instructor")?, text(word, "word")?);
            done(mind.instructed(Duration::from_nanos(now_ns), instructor, at, word.as_bytes()))
        })
    }
}

/// A gesture is being shown: opens a round, unless one is open or was opened just now.
///
/// # Safety
/// `mind` as everywhere.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gestalt_mind_open(mind: *mut Mind, now_ns: u64) -> Status {
    // SAFETY: the caller's promises are passed on.
    unsafe {
        with(mind, |mind| {
            mind.open(Duration::from_nanos(now_ns));
            Ok(Status::Ok)
        })
    }
}

/// Time has passed: owed at `gestalt_mind_next_wake`, more do no harm.
///
/// # Safety
/// `mind` as everywhere.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gestalt_mind_tick(mind: *mut Mind, now_ns: u64) -> Status {
    // SAFETY: the caller's promises are passed on.
    unsafe {
        with(mind, |mind| {
            mind.tick(Duration::from_nanos(now_ns));
            Ok(Status::Ok)
        })
    }
}

/// Whether the camera shows nothing at all: a blind robot takes part, and need not be waited for.
///
/// # Safety
/// `mind` as everywhere.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gestalt_mind_set_blind(mind: *mut Mind, now_ns: u64, blind: bool) -> Status {
    // SAFETY: the caller's promises are passed on.
    unsafe {
        with(mind, |mind| {
            mind.set_blind(Duration::from_nanos(now_ns), blind);
            Ok(Status::Ok)
        })
    }
}

/// The robots that are alive now.
///
/// # Safety
/// `mind` as everywhere; `robots` points to `length` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gestalt_mind_set_alive(
    mind: *mut Mind,
    now_ns: u64,
    robots: *const u32,
    length: usize,
) -> Status {
    // SAFETY: the caller's promises are passed on.
    unsafe { with(mind, |mind| done(mind.set_alive(Duration::from_nanos(now_ns), slice(robots, length)?))) }
}

/// The robots that this one can hear directly now, without itself: with them it compares what it knows.
///
/// # Safety
/// `mind` as everywhere; `robots` points to `length` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gestalt_mind_set_neighbours(
    mind: *mut Mind,
    now_ns: u64,
    robots: *const u32,
    length: usize,
) -> Status {
    // SAFETY: the caller's promises are passed on.
    unsafe {
        with(mind, |mind| done(mind.set_neighbours(Duration::from_nanos(now_ns), slice(robots, length)?)))
    }
}

/// When the mind wants its next tick, if nothing else comes before; `GESTALT_NEVER` if it wants none, or is null.
///
/// # Safety
/// `mind` as everywhere.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gestalt_mind_next_wake(mind: *mut Mind) -> u64 {
    let mut wake = GESTALT_NEVER;
    // SAFETY: the caller's promises are passed on.
    unsafe {
        with(mind, |mind| {
            wake = mind
                .next_wake()
                .map_or(GESTALT_NEVER, |due| due.as_nanos().try_into().unwrap_or(GESTALT_NEVER));
            Ok(Status::Ok)
        });
    }
    wake
}

/// Whether this robot takes part in a round now: it should look. `GESTALT_STATUS_NOTHING` if not.
///
/// # Safety
/// `mind` as everywhere.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gestalt_mind_is_open(mind: *mut Mind) -> Status {
    // SAFETY: the caller's promises are passed on.
    unsafe { with(mind, |mind| Ok(if mind.is_open() { Status::Ok } else { Status::Nothing })) }
}

/// Takes the next message to carry. `GESTALT_STATUS_NOTHING` if none waits; `GESTALT_STATUS_TOO_SMALL` if a buffer is too
/// small: then both lengths and the rest are written, and the message waits.
///
/// # Safety
/// `mind` as everywhere; `message` is null or points to one whose buffers have room for as many bytes as it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gestalt_mind_next_message(mind: *mut Mind, message: *mut Message) -> Status {
    // SAFETY: the caller's promises are passed on; the fields are those of the caller's message, and each write into a buffer is
    // within a room that was just compared.
    unsafe {
        with(mind, |mind| {
            if message.is_null() {
                return Err(Refused::Argument("message is null".to_owned()));
            }
            let Some(first) = mind.first_message() else { return Ok(Status::Nothing) };
            let (key, payload) = (first.key.as_bytes(), first.payload.as_slice());
            // Field by field: a reference to the whole would be one to a `bool` that nobody has written yet.
            (&raw mut (*message).key_length).write(key.len());
            (&raw mut (*message).payload_length).write(payload.len());
            (&raw mut (*message).to).write(first.to.map_or(GESTALT_TO_ALL, |robot| robot.0));
            (&raw mut (*message).json).write(first.json);
            let (key_out, key_room) = ((*message).key, (*message).key_capacity);
            let (payload_out, payload_room) = ((*message).payload, (*message).payload_capacity);
            let small = key_room <= key.len() || payload_room < payload.len();
            if small || key_out.is_null() || payload_out.is_null() {
                return Ok(Status::TooSmall);
            }
            write_out(key_out.cast(), &[key, b"\0"].concat());
            write_out(payload_out, payload);
            mind.next_message();
            Ok(Status::Ok)
        })
    }
}

/// Writes the decision held for the newest round as JSON that ends with a zero byte. `*length` becomes its length, without the
/// zero. `GESTALT_STATUS_NOTHING` before a decision; `GESTALT_STATUS_TOO_SMALL` for a buffer that has no room for it.
///
/// # Safety
/// `mind` as everywhere; `buffer` is null or has room for `capacity` bytes; `length` is null or has room for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gestalt_mind_decision(
    mind: *mut Mind,
    buffer: *mut c_char,
    capacity: usize,
    length: *mut usize,
) -> Status {
    // SAFETY: the caller's promises are passed on.
    unsafe { with(mind, |mind| write_text(mind.decision(), buffer, capacity, length)) }
}

/// Writes what is worth knowing of the mind as JSON, as `gestalt_mind_decision` writes a decision: its round, what it has
/// learned, and what it refused so far, by cause.
///
/// # Safety
/// As of `gestalt_mind_decision`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gestalt_mind_status(
    mind: *mut Mind,
    buffer: *mut c_char,
    capacity: usize,
    length: *mut usize,
) -> Status {
    // SAFETY: the caller's promises are passed on.
    unsafe { with(mind, |mind| write_text(Some(mind.status()), buffer, capacity, length)) }
}

/// # Safety
/// As of [`gestalt_mind_decision`].
unsafe fn write_text(
    text: Option<String>,
    buffer: *mut c_char,
    capacity: usize,
    length: *mut usize,
) -> Result<Status, Refused> {
    let Some(text) = text else { return Ok(Status::Nothing) };
    if !length.is_null() {
        // SAFETY: it is not null, and the caller promises room for a number.
        unsafe { length.write(text.len()) };
    }
    if buffer.is_null() || capacity <= text.len() {
        return Ok(Status::TooSmall);
    }
    // SAFETY: there is room for the text and the zero byte.
    unsafe { write_out(buffer.cast(), &[text.as_bytes(), b"\0"].concat()) };
    Ok(Status::Ok)
}

/// Makes the classifier follow what was learned since the last time. `GESTALT_STATUS_NOTHING` if there is nothing to
/// follow. It may take seconds: call it where nothing waits. After `GESTALT_STATUS_MODEL` it follows all but what could not
/// be trained on.
///
/// # Safety
/// `mind` as everywhere.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gestalt_mind_train(mind: *mut Mind, now_ns: u64) -> Status {
    // SAFETY: the caller's promises are passed on.
    unsafe {
        with(mind, |mind| {
            let trained = mind.train(Duration::from_nanos(now_ns))?;
            Ok(if trained { Status::Ok } else { Status::Nothing })
        })
    }
}

#[cfg(test)]
mod tests;
