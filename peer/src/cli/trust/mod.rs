//! `gestalt trust`: who belongs to a sealed swarm.

mod bundle;
mod folder;
mod keys;
mod revoked;
mod tell;

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use gestalt_protocol::{InstructorId, RobotId};
use gestalt_trust::{Applicant, PublicKey, Request, Roles, Roster};
use serde_json::json;

use self::folder::{applicant, client_name, said};
use self::keys::{key_here, key_of};
use self::tell::Tell;
use super::Failure;
use super::show::{counted, line};
use crate::config::ROSTER_FILE;

pub(super) use self::folder::Authority;

/// Enrol and expel the robots and clients of a sealed swarm
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt trust enrol --local --swarm demo --robots 1,2,3 keys
  gestalt trust expel 7 keys -e tls/192.168.1.5:7447")]
pub struct Args {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, clap::Subcommand)]
enum Verb {
    New(New),
    Enrol(Enrol),
    Request(Ask),
    Accept(Accept),
    Roster(Show),
    Expel(Expel),
    Rekey(Rekey),
    Tell(Again),
}

/// Make a sealed swarm: the key of its authority, and a roster without members
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt trust new --swarm demo keys
  gestalt trust new --swarm demo --local-role overrule keys")]
struct New {
    /// Name of the swarm
    #[arg(long, default_value = "gestalt", value_name = "NAME")]
    swarm: String,
    /// What whoever works on a robot's own computer may do without a key, with what comes before it: listen, open, teach, overrule
    #[arg(long, default_value = "teach", value_name = "ROLE", value_parser = Roles::named)]
    local_role: Roles,
    /// Folder to write to. authority.key can enrol robots: keep it where no robot is
    folder: PathBuf,
}

/// Make robots or a client members
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt trust enrol --local --swarm demo --robots 1,2,3 keys
  gestalt trust enrol --client desk --role teach keys")]
struct Enrol {
    /// Make the keys of these robots here, and the swarm if there is none: for robots of one computer
    #[arg(long, requires = "robots", conflicts_with_all = ["request", "client"])]
    local: bool,
    /// Ids of the robots
    #[arg(long, value_delimiter = ',', value_name = "ID,…", requires = "local")]
    robots: Vec<u32>,
    /// Name of the swarm, where --local makes one [default: that of the folder, else gestalt]
    #[arg(long, value_name = "NAME", requires = "local")]
    swarm: Option<String>,
    /// Make a client a member, and all that it needs in a folder of its own (client-NAME): a Zenoh configuration for any language, a key to speak with
    #[arg(long, value_name = "NAME", conflicts_with = "request", value_parser = client_name)]
    client: Option<InstructorId>,
    /// What the client may do, with what comes before it: listen, open, teach, overrule [default: what it may do as yet, else listen]
    #[arg(long, value_name = "ROLE", value_parser = Roles::named)]
    role: Option<Roles>,
    /// The line that `gestalt trust request` printed where the new member is
    #[arg(long, value_name = "LINE")]
    request: Option<Request>,
    #[command(flatten)]
    tell: Tell,
    /// Folder with authority.key
    folder: PathBuf,
}

/// Make a key where the new member is, and print the line to enrol it with
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt trust request 7 keys
  gestalt trust request desk desk-keys")]
struct Ask {
    /// Id of the robot, or name of the client
    #[arg(value_parser = applicant)]
    who: Applicant,
    /// Folder of the new member's key; one that is there stays
    folder: PathBuf,
    /// Make a new key in place of the one that is there
    #[arg(long)]
    anew: bool,
}

/// Take up what `gestalt trust enrol` printed, where the new member is
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt trust accept keys < membership.txt
  gestalt trust accept keys membership.txt")]
struct Accept {
    /// Folder of the new member's key
    folder: PathBuf,
    /// File with the membership [default: standard input]
    file: Option<PathBuf>,
}

/// Show who is a member, and who may do what
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt trust roster keys
  gestalt trust roster keys --json")]
struct Show {
    /// Folder with roster.json
    folder: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Take a robot or a client off the roster, in a swarm that runs: nothing it says counts any more, and its links are ended
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt trust expel 7 keys -e tls/192.168.1.5:7447
  gestalt trust expel 7 keys --offline")]
struct Expel {
    /// Id of the robot, or name of the client; robot:7 and client:7 where one name could mean either
    who: String,
    #[command(flatten)]
    tell: Tell,
    /// Change the roster alone, where no robot runs: they are told by whichever starts with it
    #[arg(long, conflicts_with = "connect")]
    offline: bool,
    /// Folder with authority.key
    folder: PathBuf,
}

/// Give a robot a new key, and take the old one's trust away: it was lost, stolen, or caught in a lie
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt trust rekey 7 keys
  gestalt trust rekey 7 keys -e tls/192.168.1.5:7447")]
struct Rekey {
    /// Id of the robot
    robot: u32,
    /// The line that `gestalt trust request --anew` printed where the robot is [default: the key is made here]
    #[arg(long, value_name = "LINE")]
    request: Option<Request>,
    #[command(flatten)]
    tell: Tell,
    /// Folder with authority.key
    folder: PathBuf,
}

/// Say the roster to a swarm that runs, again: to those who were not reached when it changed
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt trust tell keys
  gestalt trust tell keys -e tls/192.168.1.5:7447")]
struct Again {
    #[command(flatten)]
    tell: Tell,
    /// Folder with authority.key
    folder: PathBuf,
}

/// Runs the verb.
///
/// # Errors
/// What keeps the roster from being what it should be; it is then what it was.
pub fn run(args: &Args) -> Result<(), Failure> {
    match &args.verb {
        Verb::New(args) => new(args),
        Verb::Enrol(args) => enrol(args),
        Verb::Request(args) => {
            let identity = key_of(&args.folder, &args.who, args.anew)?;
            show_key(&args.who, &identity.public_key(), "enrol");
            say(&Request::new(args.who.clone(), &identity).to_string())
        }
        Verb::Accept(args) => accept(args),
        Verb::Roster(args) => show(args),
        Verb::Expel(args) => expel(args),
        Verb::Rekey(args) => rekey(args),
        Verb::Tell(args) => {
            let authority = Authority::open(&args.folder)?;
            args.tell.now(&authority, &authority.roster()?)
        }
    }
}

/// What two people compare to know that nobody has exchanged the line between them. Beside what may be piped on.
fn show_key(who: &Applicant, key: &PublicKey, other: &str) {
    let key = digits(&key.to_string());
    eprintln!("the key of {} is {key}: compare that with what `gestalt trust {other}` shows", said(who));
}

fn say(words: &str) -> Result<(), Failure> {
    line(false, &serde_json::Value::Null, words)
}

fn new(args: &New) -> Result<(), Failure> {
    let authority = Authority::create(&args.folder, &args.swarm, args.local_role)?;
    let roster = authority.roster()?;
    say(&format!(
        "swarm \"{}\" {}: {} can enrol and expel, and is to be kept where no robot is",
        args.swarm,
        fingerprint(&roster),
        args.folder.join("authority.key").display()
    ))
}

fn enrol(args: &Enrol) -> Result<(), Failure> {
    if args.role.is_some() && !args.robots.is_empty() {
        return Err("robots have no roles: whoever works on their computer has those of `gestalt trust new --local-role`".into());
    }
    let mut authority = match args.local {
        true => Authority::open_or_create(&args.folder, args.swarm.as_deref())?,
        false => Authority::open(&args.folder)?,
    };
    let mut print = None;
    let mut own = None;
    let words = if let Some(name) = &args.client {
        let who = Applicant::Client(name.clone());
        let folder = args.folder.join(format!("client-{name}"));
        let roles = args.role.unwrap_or_else(|| authority.roles(&who));
        let (key, identity) = match authority.key(&who) {
            // It keeps its key, wherever that is: with another one all that it said would lose its proof.
            Some(held) => (held, key_here(&folder, &who)?.filter(|it| it.public_key() == held)),
            // Whoever is no member any more gets another key: the old one may be in a thief's hands.
            None => {
                let here = key_here(&folder, &who)?.filter(|it| !authority.is_revoked(&it.public_key()));
                let own = here.map_or_else(|| key_of(&folder, &who, true), Ok)?;
                (own.public_key(), Some(own))
            }
        };
        authority.enrol(&who, key, roles)?;
        let place = folder.display().to_string();
        match identity {
            Some(identity) => {
                own = Some((folder, name.clone(), identity, authority.certify(&who, &key)?));
                format!("client {name} may {roles}: its key and its zenoh.json5 are in {place}")
            }
            None => format!(
                "client {name} may {roles}, with the key that it has, which is not in {place}: if it is lost, gestalt trust expel {name}, and enrol it again"
            ),
        }
    } else if let Some(request) = &args.request {
        let roles = args.role.unwrap_or_else(|| authority.roles(&request.applicant));
        authority.enrol(&request.applicant, request.key, roles)?;
        print = Some((request.applicant.clone(), authority.certify(&request.applicant, &request.key)?));
        show_key(&request.applicant, &request.key, "request");
        format!("{} is a member; where it is, `gestalt trust accept` takes this:", said(&request.applicant))
    } else if args.local {
        for robot in &args.robots {
            authority.enrol_here(RobotId(*robot))?;
        }
        String::new()
    } else {
        return Err(
            "whom? --request LINE of `gestalt trust request`, --client NAME, or --local --robots ID,…".into(),
        );
    };
    let roster = authority.save()?;
    if let Some((folder, name, identity, certificate)) = own {
        bundle::write_client(&folder, &name, identity, &roster, certificate)?;
    }
    if args.local {
        say(&in_words(&args.folder, &roster))?;
    } else {
        say(&words)?;
    }
    if let Some((who, certificate)) = print {
        say(&bundle::block(&who, &roster, &certificate)?)?;
    }
    args.tell.if_named(&args.folder, &authority, &roster)
}

fn accept(args: &Accept) -> Result<(), Failure> {
    let mut text = String::new();
    let read = match &args.file {
        Some(file) => File::open(file)
            .and_then(|file| file.take(bundle::MAX_BLOCK).read_to_string(&mut text))
            .map_err(|error| format!("cannot read {}: {error}", file.display())),
        None => std::io::stdin()
            .take(bundle::MAX_BLOCK)
            .read_to_string(&mut text)
            .map_err(|error| format!("cannot read the membership: {error}")),
    };
    read?;
    let (who, roster) = bundle::accept(&args.folder, &text)?;
    say(&format!(
        "{} is a member of the swarm \"{}\" {}: compare this with what `gestalt trust roster` shows where its authority is",
        said(&who),
        roster.members().swarm,
        fingerprint(&roster)
    ))
}

fn show(args: &Show) -> Result<(), Failure> {
    let roster: Roster = Roster::read(&args.folder.join(ROSTER_FILE))?;
    let members = roster.members();
    let mut words = vec![format!("{} {}", in_words(&args.folder, &roster), fingerprint(&roster))];
    let robots: Vec<String> = members.robots.keys().map(ToString::to_string).collect();
    words.push(format!("robots: {}", if robots.is_empty() { "none".to_owned() } else { robots.join(", ") }));
    words.push(format!("on a robot's own computer, without a key: {}", members.local));
    words.extend(members.instructors.iter().map(|(name, it)| format!("client {name}: {}", it.roles)));
    let expelled: Vec<String> = members.expelled.keys().map(ToString::to_string).collect();
    if !expelled.is_empty() {
        words.push(format!("keys of robots that are believed no more: {}", expelled.join(", ")));
    }
    let object = json!({"swarm": members.swarm, "epoch": members.epoch, "fingerprint": fingerprint(&roster), "members": members});
    line(args.json, &object, &words.join("\n"))
}

fn expel(args: &Expel) -> Result<(), Failure> {
    let who = applicant(&args.who)?;
    let mut authority = Authority::open(&args.folder)?;
    let client = format!("client:{}", args.who);
    if applicant(&client).is_ok_and(|client| client != who && authority.key(&client).is_some()) {
        return Err(format!("a client has that name, too: say robot:{} or {client}", args.who).into());
    }
    let roster = match authority.expel(&who)? {
        true => authority.save()?,
        // Said again, to those who were not reached.
        false => authority.roster()?,
    };
    say(&format!("{} is no member by epoch {}", said(&who), roster.members().epoch))?;
    if args.offline { Ok(()) } else { args.tell.now(&authority, &roster) }
}

fn rekey(args: &Rekey) -> Result<(), Failure> {
    let robot = RobotId(args.robot);
    let mut authority = Authority::open(&args.folder)?;
    let mut print = None;
    match &args.request {
        Some(request) if request.applicant == Applicant::Robot(robot) => {
            authority.rekey(robot, Some(request.key))?;
            print = Some(authority.certify(&request.applicant, &request.key)?);
        }
        Some(request) => {
            return Err(
                format!("the request is of {}, not of robot {robot}", said(&request.applicant)).into()
            );
        }
        None => authority.rekey(robot, None)?,
    }
    let roster = authority.save()?;
    say(&format!(
        "robot {robot} has a new key from epoch {} on, and its old one is believed no more: start it again with the new one",
        roster.members().epoch
    ))?;
    if let Some(certificate) = print {
        say(&bundle::block(&Applicant::Robot(robot), &roster, &certificate)?)?;
    }
    args.tell.if_named(&args.folder, &authority, &roster)
}

fn in_words(folder: &Path, roster: &Roster) -> String {
    let members = roster.members();
    let count = counted(members.robots.len(), "robot");
    format!("{count} of the swarm \"{}\" in {}, epoch {}", members.swarm, folder.display(), members.epoch)
}

/// What two people compare to know that they speak of one swarm: the first 16 digits of its id.
fn fingerprint(roster: &Roster) -> String {
    digits(&roster.swarm_id().to_string())
}

/// The first 16 digits, for people.
fn digits(hex: &str) -> String {
    let parts: Vec<&str> = (0..4).filter_map(|part| hex.get(4 * part..4 * part + 4)).collect();
    format!("({})", parts.join("-"))
}

#[cfg(test)]
mod tests;
