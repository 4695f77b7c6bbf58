//! What is recorded is what passed, whatever becomes of the file.

mod made;

use std::collections::BTreeMap;
use std::io::{self, Cursor, Write};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use gestalt_protocol::{Envelope, HeldVote, Message, RobotId, RoundId, Stamp, Topic, VocabularyId, Vote};
use gestalt_tape::foxglove::Level;
use gestalt_tape::{
    Condition, Disk, Entry, Kind, Ledger, Line, ReadError, Recorded, Recorder, Room, Sink, TapeWriter,
    WriteError, read, schema, view, wire,
};
use made::{BEGIN, SECOND, keys, one_of_each, run, said};
use proptest::prelude::*;
use serde_json::Value;

fn entries(passed: &[gestalt_tape::Passing]) -> Vec<Entry> {
    passed.iter().filter_map(|passing| passing.entry(&keys())).collect()
}

/// A recording in memory, a chunk for every `each` messages.
fn recording(entries: &[Entry], each: usize) -> Vec<u8> {
    let about = BTreeMap::from([("swarm".to_owned(), "demo".to_owned())]);
    let mut writer = TapeWriter::new(Vec::new(), about).unwrap();
    for chunk in entries.chunks(each) {
        for entry in chunk {
            assert!(writer.write(entry).unwrap());
        }
        writer.flush().unwrap();
    }
    writer.finish(BTreeMap::from([("lost".to_owned(), "0".to_owned())])).unwrap()
}

fn owned(recorded: Recorded<'_>) -> Entry {
    let Recorded { kind, channel, at, published, data } = recorded;
    Entry { kind, channel: channel.to_owned(), at, published, data: data.to_vec() }
}

fn replayed(bytes: &[u8]) -> Result<(Vec<Entry>, Condition), ReadError> {
    let mut found = Vec::new();
    let condition = read(&mut Cursor::new(bytes), |recorded| found.push(owned(recorded)))?;
    Ok((found, condition))
}

#[test]
fn what_is_read_is_what_was_written() {
    let written = entries(&one_of_each());
    let kinds: std::collections::BTreeSet<Kind> = written.iter().map(|entry| entry.kind).collect();
    assert_eq!(kinds.len(), Kind::ALL.len() - 2, "all but the recorder's own: {kinds:?}");
    let (found, condition) = replayed(&recording(&written, 5)).unwrap();
    assert_eq!(found, written);
    assert_eq!((condition.messages, condition.torn, condition.damage.len()), (written.len() as u64, None, 0));
    assert_eq!(condition.about["swarm"], "demo");
    assert_eq!(condition.end.unwrap()["lost"], "0");
}

/// Keeps what a recorder makes.
struct Kept(Arc<Mutex<Vec<Entry>>>);

impl Sink for Kept {
    fn write(&mut self, entry: &Entry) -> Result<bool, WriteError> {
        self.0.lock().unwrap().push(entry.clone());
        Ok(true)
    }

    fn pending(&self) -> usize {
        0
    }

    fn flush(&mut self) -> Result<(), WriteError> {
        Ok(())
    }

    fn finish(self, _: BTreeMap<String, String>) -> Result<(), WriteError> {
        Ok(())
    }
}

#[test]
fn another_sink_is_handed_what_a_file_holds() {
    let (kept, disk) = (Arc::<Mutex<Vec<Entry>>>::default(), Small::new(usize::MAX, Duration::ZERO));
    let onto = Recorder::onto(Kept(kept.clone()), keys(), Room::default()).unwrap();
    let into = Recorder::start(disk.clone(), keys(), BTreeMap::new(), Room::default()).unwrap();
    for recorder in [&onto, &into] {
        for passing in one_of_each() {
            recorder.intake().take(passing);
        }
        recorder.intake().say(BEGIN, Level::Error, "something failed");
    }
    let [(ledger, ended), (other, also_ended)] = [onto.finish(), into.finish()];
    ended.and(also_ended).unwrap();
    assert_eq!((&ledger.received, &ledger.written), (&other.received, &other.written));
    let of_swarm = |entry: &Entry| entry.kind != Kind::Recorder;
    let (mut handed, bytes) = (kept.lock().unwrap().clone(), disk.bytes.lock().unwrap().clone());
    let (mut filed, _) = replayed(&bytes).unwrap();
    assert!(handed.iter().any(|entry| entry.kind == Kind::Recorder), "it says what it received");
    handed.retain(of_swarm);
    filed.retain(of_swarm);
    assert_eq!(handed, filed);
    // The channels that are said to be there before anything is are those that messages then have.
    let channels = Entry::channels(&keys(), None);
    assert!(handed.iter().any(|entry| channels.contains(&(entry.kind, entry.channel.clone()))));
}

#[test]
fn every_message_comes_back_as_it_travelled() {
    for passing in one_of_each() {
        let entry = passing.entry(&keys()).unwrap();
        if matches!(entry.kind, Kind::Frame | Kind::Unreadable) {
            continue;
        }
        let recorded = Recorded {
            kind: entry.kind,
            channel: &entry.channel,
            at: entry.at,
            published: entry.published,
            data: &entry.data,
        };
        match Line::of(&recorded).unwrap() {
            Line::Say(topic, bytes) => assert_eq!((topic, bytes), (passing.topic, passing.payload)),
            Line::Present(robot, _) => assert_eq!(Topic::Alive(robot), passing.topic),
        }
    }
}

/// What of the value is not as the schema says, for the part of JSON Schema that is used.
fn faults(schema: &Value, value: &Value, path: &str) -> Vec<String> {
    let mut found = Vec::new();
    let Some(kind) = schema["type"].as_str() else {
        assert_eq!(schema.as_object().map(serde_json::Map::len), Some(0), "anything goes");
        return found;
    };
    let is = match kind {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "boolean" => value.is_boolean(),
        "integer" => value.is_u64() || value.is_i64(),
        "number" => value.is_number(),
        other => panic!("{other} is not used"),
    };
    if !is {
        found.push(format!("{path} is no {}", schema["type"]));
    }
    if schema["enum"].as_array().is_some_and(|words| !words.contains(value)) {
        found.push(format!("{path} is none of {}", schema["enum"]));
    }
    let number = value.as_f64();
    let below = |limit: &Value| limit.as_f64().zip(number).is_some_and(|(limit, number)| number < limit);
    let above = |limit: &Value| limit.as_f64().zip(number).is_some_and(|(limit, number)| number > limit);
    if below(&schema["minimum"]) || above(&schema["maximum"]) {
        found.push(format!("{path} is out of range"));
    }
    for (i, item) in value.as_array().into_iter().flatten().enumerate() {
        found.extend(faults(&schema["items"], item, &format!("{path}[{i}]")));
    }
    for (name, field) in value.as_object().into_iter().flatten() {
        let path = format!("{path}.{name}");
        match (&schema["properties"][name], &schema["additionalProperties"]) {
            (Value::Null, Value::Bool(false)) => found.push(format!("{path} is not in the schema")),
            (Value::Null, other) => found.extend(faults(other, field, &path)),
            (of, _) => found.extend(faults(of, field, &path)),
        }
    }
    for required in schema["required"].as_array().into_iter().flatten() {
        if value.get(required.as_str().unwrap()).is_none() {
            found.push(format!("{path} lacks {required}"));
        }
    }
    found
}

#[test]
fn every_message_is_as_its_schema_says() {
    for entry in entries(&one_of_each()) {
        if let Some(schema) = schema(entry.kind) {
            let value: Value = serde_json::from_slice(&entry.data).unwrap();
            assert_eq!(faults(&schema, &value, entry.kind.schema()), Vec::<String>::new(), "{value:#}");
        }
    }
}

#[test]
fn a_file_cut_anywhere_is_read_up_to_its_last_whole_chunk() {
    let written = entries(&run()[..12]);
    let bytes = recording(&written, 4);
    let mut lengths = std::collections::BTreeSet::new();
    for cut in 0..bytes.len() {
        match replayed(&bytes[..cut]) {
            Ok((found, condition)) => {
                assert_eq!(found, written[..found.len()], "cut at {cut}");
                assert!(
                    found.len().is_multiple_of(4) && condition.damage.is_empty(),
                    "cut at {cut}: {condition:?}"
                );
                lengths.insert(found.len());
                // The footer is 29 bytes, the magic after it 8.
                assert_eq!(condition.torn.is_some(), cut < bytes.len() - 8, "cut at {cut}");
            }
            Err(error) => assert!(cut < 8 && matches!(error, ReadError::NotMcap), "cut at {cut}: {error}"),
        }
    }
    assert_eq!(lengths.into_iter().collect::<Vec<_>>(), [0, 4, 8, 12]);
}

#[test]
fn a_damaged_chunk_is_named_and_those_beside_it_are_read() {
    let written = entries(&run()[..12]);
    let bytes = recording(&written, 4);
    let needle = written[5].data.as_slice();
    let place = bytes.windows(needle.len()).position(|window| window == needle).unwrap();
    let mut damaged = bytes.clone();
    damaged[place + 20] ^= 1;
    let (found, condition) = replayed(&damaged).unwrap();
    let others: Vec<Entry> = written[..4].iter().chain(&written[8..]).cloned().collect();
    assert_eq!(found, others, "though the damaged chunk introduced channels");
    assert_eq!(condition.damage.len(), 1);
    let (at, what) = &condition.damage[0];
    assert!((*at as usize) < place && what.contains("checksum"), "{at}: {what}");
    assert!(condition.remarks()[0].contains(&format!("damaged at byte {at}")));
}

#[test]
fn no_flipped_byte_panics_or_makes_a_message_that_was_never_written() {
    let written = entries(&run()[..10]);
    let bytes = recording(&written, 5);
    for place in 0..bytes.len() {
        for mask in [1, 0x80, 0xff] {
            let mut flipped = bytes.clone();
            flipped[place] ^= mask;
            if let Ok((found, _)) = replayed(&flipped) {
                assert!(found.len() <= written.len(), "byte {place}");
                // A flip in a chunk's own checksum or contents loses the chunk; nothing else comes of it.
                assert!(found.iter().all(|entry| written.contains(entry)), "byte {place}, mask {mask}");
            }
        }
    }
}

proptest! {
    #[test]
    fn a_vote_comes_back_from_its_json_bit_for_bit(
        evidence in prop::collection::vec(any::<f32>().prop_filter("finite", |value| value.is_finite()), 2..12),
        looks in 0.0f32..1e30, ids in any::<[u32; 6]>(),
    ) {
        let [robot, counter, opener, life, boot, sequence] = ids;
        let round = RoundId { counter, opener: RobotId(opener), life };
        let vote = Vote { round, vocabulary: VocabularyId(ids[0] ^ ids[1]), evidence, looks, unknown: None, named: vec![] };
        let (robot, stamp) = (RobotId(robot), Stamp { boot, sequence });
        let bytes = Envelope { author: robot, stamp, message: Message::Vote(vote.clone()), signature: None }.encode();
        let view = view(&Topic::Vote(robot), &bytes).unwrap();
        prop_assert!(view.get("wire").is_none(), "the JSON alone gives the bytes");
        let text = view.to_string();
        let read: Value = serde_json::from_str(&text).unwrap();
        prop_assert_eq!(wire(&Topic::Vote(robot), &read), Some(bytes));
        let held: HeldVote = serde_json::from_value(read).unwrap();
        prop_assert_eq!(held.vote, vote);
    }

    #[test]
    fn no_bytes_under_any_key_panic_and_none_are_lost(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let topics = [
            Topic::Vote(RobotId(1)), Topic::Sample(RobotId(1)), Topic::RobotDecision(RobotId(1)), Topic::Decision, Topic::Question,
            Topic::Status(RobotId(1)), Topic::Evidence, Topic::Feedback("ada".parse().unwrap()),
            Topic::Answer("ada".parse().unwrap()), Topic::Frame(RobotId(1)), Topic::Alive(RobotId(1)),
        ];
        for topic in topics {
            let entry = said(topic, bytes.clone(), BEGIN).entry(&keys()).unwrap();
            let schema = schema(entry.kind);
            let value: Option<Value> = serde_json::from_slice(&entry.data).ok();
            if let (Some(schema), Some(value)) = (schema, value) {
                prop_assert_eq!(faults(&schema, &value, ""), Vec::<String>::new());
            }
        }
    }

    #[test]
    fn no_bytes_are_a_recording_that_panics(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let _ = replayed(&bytes);
        let _ = replayed(&[mcap::MAGIC, &bytes].concat());
    }
}

/// A file that takes `room` bytes, each write as long as `delay`.
#[derive(Clone)]
struct Small {
    bytes: Arc<Mutex<Vec<u8>>>,
    room: usize,
    delay: Duration,
}

impl Small {
    fn new(room: usize, delay: Duration) -> Self {
        Self { bytes: Arc::default(), room, delay }
    }
}

impl Write for Small {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        std::thread::sleep(self.delay);
        let mut held = self.bytes.lock().unwrap();
        if held.len() + bytes.len() > self.room {
            return Err(io::ErrorKind::StorageFull.into());
        }
        held.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn total(ledger: &Ledger) -> u64 {
    Ledger::total(&ledger.written) + Ledger::total(&ledger.dropped) + Ledger::total(&ledger.lost)
}

#[test]
fn a_slow_recorder_holds_up_nobody_and_says_what_it_dropped() {
    let disk = Small::new(usize::MAX, Duration::from_millis(20));
    let room = Room { messages: 8, bytes: 1 << 20 };
    let recorder = Recorder::start(disk.clone(), keys(), BTreeMap::new(), room).unwrap();
    let passed = run();
    let began = Instant::now();
    for i in 0..2000 {
        recorder.intake().take(passed[i % passed.len()].clone());
    }
    assert!(began.elapsed() < Duration::from_secs(1), "it took {:?}", began.elapsed());
    let (ledger, ended) = recorder.finish();
    ended.unwrap();
    assert_eq!((Ledger::total(&ledger.received), total(&ledger)), (2000, 2000));
    assert!(Ledger::total(&ledger.dropped) > 1000 && !ledger.is_whole(), "{ledger:?}");
    let bytes = disk.bytes.lock().unwrap().clone();
    let (found, condition) = replayed(&bytes).unwrap();
    let end = condition.end.unwrap();
    assert_eq!(end["dropped"], Ledger::total(&ledger.dropped).to_string(), "the file says it too");
    let own = found.iter().filter(|entry| matches!(entry.kind, Kind::Log | Kind::Recorder)).count();
    assert_eq!((found.len() - own) as u64, Ledger::total(&ledger.written));
}

#[test]
fn large_messages_fill_the_queue_by_their_bytes() {
    let disk = Small::new(usize::MAX, Duration::from_millis(50));
    let room = Room { messages: 1000, bytes: 100_000 };
    let recorder = Recorder::start(disk, keys(), BTreeMap::new(), room).unwrap();
    for _ in 0..20 {
        recorder.intake().take(said(Topic::Evidence, vec![0; 90_000], BEGIN));
    }
    let (ledger, ended) = recorder.finish();
    ended.unwrap();
    assert!(Ledger::total(&ledger.dropped) >= 10, "{ledger:?}");
    assert_eq!(total(&ledger), 20);
}

#[test]
fn a_full_disk_ends_the_recording_with_an_account_of_what_is_in_it_and_what_is_not() {
    let disk = Small::new(40_000, Duration::ZERO);
    let recorder = Recorder::start(disk.clone(), keys(), BTreeMap::new(), Room::default()).unwrap();
    let passed = run();
    let mut handed = 0;
    while !recorder.intake().has_failed() {
        recorder.intake().take(passed[handed % passed.len()].clone());
        handed += 1;
        std::thread::sleep(Duration::from_micros(200));
    }
    for _ in 0..10 {
        recorder.intake().take(passed[0].clone());
    }
    let (ledger, ended) = recorder.finish();
    let error = ended.unwrap_err().to_string();
    assert!(error.contains("cannot write the recording"), "{error}");
    assert_eq!(total(&ledger), handed as u64 + 10);
    assert!(Ledger::total(&ledger.lost) >= 10, "{ledger:?}");
    assert!(ledger.missing().unwrap().contains("the disk took no more"));
}

#[test]
fn a_file_that_is_there_is_never_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    std::fs::write(&path, "precious").unwrap();
    assert_eq!(Disk::create(&path).unwrap_err().kind(), io::ErrorKind::AlreadyExists);
    assert_eq!(std::fs::read(&path).unwrap(), b"precious");
}

#[test]
fn what_was_heard_is_soon_on_the_disk_though_nothing_follows() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let disk = Disk::create(&path).unwrap();
    let recorder = Recorder::start(disk, keys(), BTreeMap::new(), Room::default()).unwrap();
    let passed = run();
    passed.iter().for_each(|passing| recorder.intake().take(passing.clone()));
    // Within a second; how long a busy disk takes is not judged here.
    let patience = Instant::now() + Duration::from_secs(20);
    loop {
        // As after a kill: no footer, and the recorder is still there.
        let (found, condition) = replayed(&std::fs::read(&path).unwrap()).unwrap();
        let swarm = found.iter().filter(|entry| !matches!(entry.kind, Kind::Log | Kind::Recorder)).count();
        if swarm == passed.len() {
            assert!(condition.torn.is_some() && condition.end.is_none());
            break;
        }
        assert!(Instant::now() < patience, "{swarm} of {}", passed.len());
        std::thread::sleep(Duration::from_millis(50));
    }
    recorder.finish().1.unwrap();
    let (_, condition) = replayed(&std::fs::read(&path).unwrap()).unwrap();
    assert!(condition.torn.is_none() && condition.end.is_some());
}

#[test]
fn more_channels_than_a_file_has_room_for_are_dropped_and_counted() {
    let disk = Small::new(usize::MAX, Duration::ZERO);
    let recorder =
        Recorder::start(disk, keys(), BTreeMap::new(), Room { messages: 1 << 16, bytes: 1 << 30 }).unwrap();
    for robot in 0..20_000 {
        recorder.intake().take(gestalt_tape::Passing::presence(
            RobotId(robot),
            true,
            BEGIN + u64::from(robot) * SECOND,
        ));
    }
    let (ledger, ended) = recorder.finish();
    ended.unwrap();
    assert_eq!(total(&ledger), 20_000);
    assert_eq!(ledger.dropped[&Kind::Alive], 20_000 - 16_384);
}
