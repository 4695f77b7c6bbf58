//! Whether one robot can do its work: rules over what was gathered on its machine.

use std::path::PathBuf;
use std::time::Duration;

use gestalt_protocol::{Camera, CameraState, RobotId};

use super::finding::Finding;

/// What was gathered about one robot, on its machine.
#[derive(Clone, Debug)]
pub struct RobotFacts {
    /// Which robot.
    pub id: RobotId,
    /// Whether that very robot runs on this machine while it is looked at: it holds its port, its camera and its memory.
    pub running: bool,
    /// The file that describes it, or the flags; `None` when no robot is described.
    pub described: Option<String>,
    /// Why the description cannot be read at all.
    pub unreadable: Option<String>,
    /// What is wrong with the description, by key.
    pub problems: Vec<String>,
    /// Its classifier, in words, or why it cannot be read; `None` for a robot without one.
    pub model: Option<Result<String, String>>,
    /// Where it remembers; `None` for a robot that does not.
    pub memory: Option<MemoryFacts>,
    /// Its key and roster; `None` in an open swarm.
    pub keys: Option<KeyFacts>,
    /// The endpoints with a port of their own that it listens on.
    pub ports: Vec<PortFacts>,
    /// Whether multicast comes back, or why not; `None` for a robot that does not use it.
    pub multicast: Option<Result<(), String>>,
    /// Whether endpoints are named that it connects to.
    pub connects: bool,
    /// What it sees with; `None` for a robot without a camera of this machine.
    pub camera: Option<CameraFacts>,
    /// The clock of this machine: the time since 1970.
    pub clock: Duration,
}

impl RobotFacts {
    /// Nothing but who it is, and the clock of its machine.
    #[must_use]
    pub fn new(id: RobotId, clock: Duration) -> Self {
        Self {
            id,
            running: false,
            described: None,
            unreadable: None,
            problems: Vec::new(),
            model: None,
            memory: None,
            keys: None,
            ports: Vec::new(),
            multicast: None,
            connects: false,
            camera: None,
            clock,
        }
    }
}

/// A robot's memory on disk.
#[derive(Clone, Debug)]
pub struct MemoryFacts {
    /// The file, by its absolute path.
    pub path: PathBuf,
    /// Whether a change could be written.
    pub room: Room,
    /// Whether another process holds the file.
    pub held: bool,
    /// What keeps a robot from starting with it; `None`: nothing, or it was not looked into.
    pub trouble: Option<String>,
}

/// Whether there is room for a memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Room {
    /// For [`ROOM`] bytes at least.
    Enough,
    /// For fewer.
    Full,
    /// Its folder is not there.
    NoFolder,
    /// It cannot be written: what the system says.
    ReadOnly(String),
    /// It cannot be read, though it may be sound.
    Unreadable(String),
}

/// How many bytes of room a memory must find: it grows, and a database writes a change beside what it changes.
pub const ROOM: usize = 8 << 20;

/// What makes a robot a member of a sealed swarm.
#[derive(Clone, Debug)]
pub struct KeyFacts {
    /// The folder.
    pub folder: PathBuf,
    /// This robot's key file.
    pub key: PathBuf,
    /// Whether other users can read the key.
    pub exposed: bool,
    /// What else keeps it from being a member.
    pub trouble: Option<String>,
    /// Why nothing can be written to the folder.
    pub locked: Option<String>,
}

/// An endpoint to listen on.
#[derive(Clone, Debug)]
pub struct PortFacts {
    /// The endpoint, `tcp/0.0.0.0:7447`.
    pub endpoint: String,
    /// Why it cannot be had; `None` when it is free, or held by this very robot.
    pub taken: Option<String>,
}

/// A camera that was tried.
#[derive(Clone, Debug)]
pub struct CameraFacts {
    /// What it is, in words.
    pub source: String,
    /// The line of configuration that names it.
    pub setting: String,
    /// Cameras that are there.
    pub devices: Vec<String>,
    /// Whether it runs by itself, and serves one program at a time: a device, or a pipe.
    pub live: bool,
    /// Whether the running robot says that it has it.
    pub held: bool,
    /// Width and height that its model says, in pixels.
    pub size: [u32; 2],
    /// Frames per second that its model says.
    pub fps: f64,
    /// What it gave, or why nothing.
    pub gave: Result<Given, String>,
}

/// What a camera gave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Given {
    /// Width and height of its frames, in pixels.
    pub size: [u32; 2],
    /// Frames per second, of one that runs by itself.
    pub fps: Option<f64>,
    /// Standard deviation of the grey levels within its most varied frame: 0 for one colour.
    pub contrast: f64,
    /// Whether a camera that runs by itself gave the same picture over and over.
    pub same: bool,
}

/// Below this contrast, in grey levels, a picture shows nothing: the noise of a covered sensor has 1 to 3.
pub const BLIND: f64 = 4.0;

/// What boot numbers are counted from, and how long they last: 2026, and 13 years.
const CLOCK: (Duration, Duration) = (Duration::from_secs(1_767_225_600), Duration::from_secs(2_192_000_000));

/// What there is to say about one robot.
#[must_use]
pub fn findings(facts: &RobotFacts) -> Vec<Finding> {
    let mut found = vec![clock(facts.clock)];
    if let Some(described) = &facts.described {
        found.extend(configuration(described, facts));
        found.extend(facts.model.as_ref().map(model));
        found.extend(facts.memory.as_ref().map(|it| memory(it, facts.running)));
        found.extend(facts.keys.as_ref().map(|it| keys(it, facts.id)));
        found.extend(facts.ports.iter().map(port));
        found.extend(facts.camera.as_ref().map(camera));
    }
    found.extend(facts.multicast.as_ref().map(|it| multicast(it, facts.connects)));
    found
}

fn clock(now: Duration) -> Finding {
    let said =
        format!("{}", humantime_serde::re::humantime::format_rfc3339_seconds(std::time::UNIX_EPOCH + now));
    if now >= CLOCK.0 && now < CLOCK.1 {
        return Finding::fine("clock", format!("it is {said}"));
    }
    Finding::failure(
        "clock",
        format!("the clock of this machine says {said}"),
        "robots without a memory number their starts by the clock: what one says after a restart may count as old",
        "sudo timedatectl set-ntp true     (without a network: sudo date -s '2026-11-23 12:00')",
    )
}

fn configuration(described: &str, facts: &RobotFacts) -> Vec<Finding> {
    const WHY: &str = "a robot with this configuration does not start";
    if let Some(cause) = &facts.unreadable {
        let fix =
            "check the path, and the place that is named; a file to begin with: gestalt config > robot.json5";
        return vec![Finding::failure("configuration", cause.clone(), WHY, fix)];
    }
    if facts.problems.is_empty() {
        return vec![Finding::fine("configuration", format!("{described}: a robot can start with it"))];
    }
    let of_one = |problem: &String| {
        Finding::failure(
            "configuration",
            format!("{described}: {problem}"),
            WHY,
            "correct the key; `gestalt config` prints every key with its meaning and its default",
        )
    };
    facts.problems.iter().map(of_one).collect()
}

fn model(model: &Result<String, String>) -> Finding {
    match model {
        Ok(name) => Finding::fine("model", name.clone()),
        Err(cause) => Finding::failure(
            "model",
            cause.clone(),
            "without its classifier the robot does not start",
            "train it again: gestalt train --dataset DIR --out hands.gestalt; or model: \"hands\"",
        ),
    }
}

fn memory(memory: &MemoryFacts, running: bool) -> Finding {
    let (path, shown) = (&memory.path, memory.path.display());
    let folder = gestalt_file::folder(path).display();
    let lost = "what the robot learns is lost when it stops, and until it can write it answers no instructor and shares nothing";
    match &memory.room {
        Room::NoFolder => Finding::failure(
            "memory",
            format!("{shown}: the folder {folder} is not there"),
            lost,
            format!("mkdir -p {folder}     (or mount the disk that it is on)"),
        ),
        Room::Full => Finding::failure(
            "memory",
            format!("{shown}: the disk has no room for {} MB more", ROOM >> 20),
            lost,
            format!("make room: df -h {folder}; or learning: {{memory: \"FILE\"}} on another disk"),
        ),
        Room::ReadOnly(cause) => Finding::failure(
            "memory",
            format!("{shown}: cannot be written: {cause}"),
            lost,
            format!(
                "look as the user that the robot runs as, in the folder it starts in: sudo -u gestalt gestalt doctor FILE; or sudo mount -o remount,rw {folder}; or learning: {{memory: \"FILE\"}} elsewhere"
            ),
        ),
        // Nothing says that it is lost: it is not to be moved away.
        Room::Unreadable(cause) => Finding::failure(
            "memory",
            cause.clone(),
            lost,
            format!(
                "sudo dmesg | tail     shows what the disk says; or learning: {{memory: \"FILE\"}} on another disk, with a copy of {shown}"
            ),
        ),
        Room::Enough if memory.held && !running => Finding::failure(
            "memory",
            format!("{shown}: another process has it open"),
            "a robot whose memory is in use does not start; two robots with one memory would say each other's words",
            format!("fuser {shown}     shows who; or learning: {{memory: \"FILE\"}} of its own"),
        ),
        Room::Enough => match &memory.trouble {
            Some(trouble) => Finding::failure(
                "memory",
                trouble.clone(),
                "the robot refuses to start, so that nothing that was learned is written over",
                format!("restore a copy of it; or begin anew: mv {shown} {shown}.damaged"),
            ),
            None => Finding::fine("memory", format!("{shown}: can be written")),
        },
    }
}

fn keys(keys: &KeyFacts, robot: RobotId) -> Finding {
    let (folder, key) = (keys.folder.display(), keys.key.display());
    if keys.exposed {
        return Finding::failure(
            "keys",
            format!("{key}: other users of this machine can use the robot's key"),
            "whoever has the key can vote as this robot; the robot refuses to start with it",
            format!("chmod 600 {key}     (if nobody else was ever on this machine; else make a new key)"),
        );
    }
    match (&keys.trouble, &keys.locked) {
        (None, Some(cause)) => Finding::failure(
            "keys",
            format!("{folder}: cannot be written: {cause}"),
            "the number of each start and newer rosters are kept there: without, the robot draws numbers at random, and starts with an old roster",
            format!(
                "let the user that the robot runs as write to {folder}; a service: sudo mv {folder} /var/lib/gestalt/keys, and trust: {{keys: \"/var/lib/gestalt/keys\"}}"
            ),
        ),
        (None, None) => {
            Finding::fine("keys", format!("{folder}: robot {robot} is on the roster with its key"))
        }
        (Some(trouble), _) => Finding::failure(
            "keys",
            trouble.clone(),
            "a robot that is no member of its sealed swarm does not start, or none believes it",
            format!(
                "gestalt trust request {robot} {folder}     here; then gestalt trust enrol --request LINE keys     where authority.key is, and gestalt trust accept {folder}     here"
            ),
        ),
    }
}

fn port(port: &PortFacts) -> Finding {
    let endpoint = &port.endpoint;
    match &port.taken {
        None => Finding::fine("port", format!("{endpoint}: can be listened on")),
        Some(cause) => {
            let number = endpoint.rsplit(':').next().unwrap_or_default();
            let free = endpoint.strip_suffix(number).map_or("auto".to_owned(), |host| format!("{host}0"));
            Finding::failure(
                "port",
                format!("{endpoint}: {cause}"),
                "a robot that cannot listen on its endpoint does not start",
                format!("ss -ltnp 'sport = :{number}'     shows who holds it; or take a free one: -l {free}"),
            )
        }
    }
}

fn multicast(multicast: &Result<(), String>, connects: bool) -> Finding {
    let Err(cause) = multicast else { return Finding::fine("multicast", "comes back on this machine") };
    let what = format!("multicast does not work here: {cause}");
    let fix = "name the endpoints: -l tls/0.0.0.0:7447 on one robot, -e tls/ITS-ADDRESS:7447 on the others (tcp/ in an open swarm), and \
               --no-multicast-scouting; or links: {scouting: {interface: \"eth0\"}}";
    if connects {
        Finding::warning("multicast", what, "robots are found at the endpoints named alone", fix)
    } else {
        Finding::failure("multicast", what, "the robot finds no others, and none finds it", fix)
    }
}

/// Whether a robot that runs, and says that of its camera, has the camera of that source.
#[must_use]
pub fn has(said: &Camera, source: &str) -> bool {
    let delivers = matches!(said.state, CameraState::Opening | CameraState::Live | CameraState::Frozen);
    delivers && said.source.replacen("video pipe ", "video ", 1) == source
}

fn camera(camera: &CameraFacts) -> Finding {
    let source = &camera.source;
    let blind = "a robot that sees nothing gives no evidence";
    let given = match &camera.gave {
        Ok(given) => given,
        // It serves one program at a time; the status of the one that runs says how it goes.
        Err(_) if camera.held && camera.live => {
            return Finding::fine("camera", format!("{source}: the running robot has it"));
        }
        Err(cause) => return Finding::failure("camera", cause.clone(), blind, camera_fix(camera, cause)),
    };
    let [width, height] = given.size;
    if given.contrast < BLIND || given.same {
        let how = if given.same { "the same picture over and over" } else { "pictures of one colour" };
        return Finding::failure(
            "camera",
            format!("{source}: it gives {how}"),
            blind,
            "uncover the lens, give it light, unplug it and plug it in again; gestalt look SOURCE shows what it sees",
        );
    }
    let asked = format!("{}×{} at {} per second", camera.size[0], camera.size[1], camera.fps);
    let gives = given.fps.map_or_else(
        || format!("{width}×{height}"),
        |fps| format!("{width}×{height} at {fps:.1} per second"),
    );
    let slow = given.fps.is_some_and(|fps| fps < 0.6 * camera.fps);
    if given.size != camera.size || slow {
        return Finding::warning(
            "camera",
            format!("{source}: it gives {gives}, its model says {asked}"),
            "frames are read as what they are; what the model says of field of view and noise may not fit them",
            format!(
                "camera: {{model: {{custom: {{name: \"mine\", width_px: {width}, height_px: {height}, fps: {:.0}, …}}}}}}     (gestalt config lists all of it)",
                given.fps.unwrap_or(camera.fps).max(1.0)
            ),
        );
    }
    Finding::fine("camera", format!("{source}: {gives}"))
}

fn camera_fix(camera: &CameraFacts, cause: &str) -> String {
    if !camera.source.starts_with("device") {
        return format!("{}     with what is there", camera.setting);
    }
    if cause.contains("no permission") {
        return "sudo usermod -aG video $USER     and log in again".to_owned();
    }
    match camera.devices.as_slice() {
        [] => "plug a camera in; v4l2-ctl --list-devices shows it then".to_owned(),
        [first, ..] => format!("--source {first}     (there are {})", camera.devices.join(", ")),
    }
}
