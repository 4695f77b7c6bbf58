//! What the verbs say and write.

use clap::Parser;

use super::*;

#[derive(Parser)]
struct Line {
    #[command(flatten)]
    args: Args,
}

fn run(words: &[&str]) -> Result<(), Failure> {
    super::run(&Line::parse_from([&["trust"], words].concat()).args)
}

#[test]
fn a_client_that_was_expelled_comes_back_with_a_new_key() {
    let folder = tempfile::tempdir().unwrap();
    let keys = folder.path().join("keys").display().to_string();
    let desk = "desk".parse().unwrap();
    let held = || {
        let roster: Roster = Roster::read(&Path::new(&keys).join(ROSTER_FILE)).unwrap();
        roster.members().instructors.get(&desk).copied()
    };
    let key = || held().map(|held| held.key);
    run(&["new", "--swarm", "demo", &keys]).unwrap();
    run(&["enrol", "--client", "desk", "--role", "open", &keys]).unwrap();
    let first = key().unwrap();
    run(&["enrol", "--client", "desk", "--role", "teach", &keys]).unwrap();
    run(&["enrol", "--client", "desk", "--role", "listen", &keys]).unwrap();
    assert_eq!(key(), Some(first), "another role takes no key away");
    run(&["enrol", "--client", "desk", &keys]).unwrap();
    assert_eq!(held().unwrap().roles, Roles::NONE, "and none was named");
    let [own, desks] = ["client-desk", "desk"].map(|folder| Path::new(&keys).join(folder));
    std::fs::rename(&own, &desks).unwrap();
    run(&["enrol", "--client", "desk", "--role", "teach", &keys]).unwrap();
    run(&["enrol", "--client", "desk", &keys]).unwrap();
    assert!(key() == Some(first) && held().unwrap().roles != Roles::NONE, "also where its key is elsewhere");
    assert!(!own.exists(), "no second key is made");
    let other = Request::new(
        Applicant::Client(desk.clone()),
        &key_of(&folder.path().join("thief"), &Applicant::Client(desk.clone()), false).unwrap(),
    );
    let refused = run(&["enrol", "--request", &other.to_string(), &keys]).unwrap_err().to_string();
    assert!(refused.contains("another key") && refused.contains("expel desk"), "{refused}");
    std::fs::rename(&desks, &own).unwrap();
    run(&["expel", "desk", "--offline", &keys]).unwrap();
    assert_eq!(key(), None);
    run(&["enrol", "--client", "desk", "--role", "teach", &keys]).unwrap();
    assert!(key().is_some_and(|key| key != first));
    let file = Path::new(&keys).join("client-desk");
    assert_eq!(key_of(&file, &Applicant::Client(desk.clone()), false).unwrap().public_key(), key().unwrap());
}

#[test]
fn no_client_is_taken_for_a_robot() {
    let folder = tempfile::tempdir().unwrap();
    let keys = folder.path().join("keys").display().to_string();
    let roster = || -> Roster { Roster::read(&Path::new(&keys).join(ROSTER_FILE)).unwrap() };
    run(&["enrol", "--local", "--swarm", "demo", "--robots", "7", &keys]).unwrap();
    let seven = Applicant::Client("7".parse().unwrap());
    let line = Request::new(seven.clone(), &key_of(folder.path(), &seven, false).unwrap()).to_string();
    let refused = run(&["enrol", "--request", &line, &keys]).unwrap_err().to_string();
    assert!(
        refused.contains("robot 7") && client_name("7").is_err() && client_name("7a").is_ok(),
        "{refused}"
    );
    // As earlier releases let it be.
    let key = key_of(folder.path(), &Applicant::Client("7".parse().unwrap()), false).unwrap().public_key();
    let mut members = roster().members().clone();
    members.epoch += 1;
    members.instructors.insert("7".parse().unwrap(), gestalt_trust::Instructor { key, roles: Roles::NONE });
    let authority = Authority::open(Path::new(&keys)).unwrap().identity();
    members.sign(&authority).unwrap().write(&Path::new(&keys).join(ROSTER_FILE)).unwrap();
    let refused = run(&["expel", "7", "--offline", &keys]).unwrap_err().to_string();
    assert!(refused.contains("robot:7 or client:7"), "{refused}");
    run(&["expel", "client:7", "--offline", &keys]).unwrap();
    assert!(roster().members().instructors.is_empty() && roster().members().robots.len() == 1);
    run(&["expel", "7", "--offline", &keys]).unwrap();
    assert!(roster().members().robots.is_empty());
}
