//! Who is a member, whatever happens while that changes.

use super::super::keys::key_of;
use super::*;
use crate::config::TrustSection;

/// A new swarm of these robots.
fn swarm_of(folder: &Path, robots: &[u32]) -> (Authority, Roster) {
    let mut authority = Authority::create(folder, "demo", Roles::NONE).unwrap();
    robots.iter().for_each(|robot| authority.enrol_here(RobotId(*robot)).unwrap());
    let roster = authority.save().unwrap();
    (authority, roster)
}

#[test]
fn robots_are_enrolled_one_after_the_other_and_keep_their_keys() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path().join("keys");
    let enrol = |robots: &[u32]| {
        let mut authority = Authority::open_or_create(&folder, Some("demo")).unwrap();
        robots.iter().for_each(|robot| authority.enrol_here(RobotId(*robot)).unwrap());
        authority.save().unwrap()
    };
    let (first, second) = (enrol(&[1, 2]), enrol(&[2, 3]));
    assert!(second.newer_than(&first));
    let (first, second) = (first.members(), second.members());
    assert_eq!((first.robots.len(), second.robots.len()), (2, 3));
    assert_eq!(first.robots[&RobotId(2)], second.robots[&RobotId(2)]);
    let other = Authority::open_or_create(&folder, Some("other")).map(drop).unwrap_err().to_string();
    assert!(other.contains("say --swarm demo, or choose another folder"), "{other}");
    assert_eq!(Authority::open_or_create(&folder, None).unwrap().members.swarm, "demo");
    let trust = TrustSection { keys: Some(folder), ..TrustSection::default() };
    let seal = trust.seal(RobotId(3)).unwrap().unwrap();
    assert_eq!(seal.identity.public_key(), second.robots[&RobotId(3)]);
    assert!(seal.credentials(RobotId(3)).is_ok() && seal.credentials(RobotId(2)).is_err());
    let missing = trust.seal(RobotId(4)).unwrap_err().to_string();
    assert!(missing.contains("trust.keys") && missing.contains("robot-4.key"), "{missing}");
    let of_guest = trust.identity(RobotId(1)).unwrap().unwrap();
    assert_eq!(of_guest.public_key(), second.robots[&RobotId(1)]);
    let missing = trust.identity(RobotId(4)).unwrap_err().to_string();
    assert!(missing.contains("robot-4.key"), "{missing}");
}

#[test]
fn who_was_expelled_comes_back_with_a_new_key_alone() {
    let folder = tempfile::tempdir().unwrap();
    let (mut authority, roster) = swarm_of(folder.path(), &[1, 7]);
    let before = roster.members().robots[&RobotId(7)];
    authority.expel(&Applicant::Robot(RobotId(7))).unwrap();
    let roster = authority.save().unwrap();
    assert!(
        !roster.members().robots.contains_key(&RobotId(7))
            && roster.members().expelled[&RobotId(7)] == before
    );
    assert!(!authority.expel(&Applicant::Robot(RobotId(7))).unwrap(), "it is none already");
    assert!(authority.expel(&Applicant::Robot(RobotId(8))).unwrap_err().to_string().contains("no member"));
    // With its old key, which still lies there.
    let refused = authority.enrol_here(RobotId(7)).unwrap_err().to_string();
    assert!(refused.contains("rekey 7"), "{refused}");
    drop(authority);
    let mut authority = Authority::open(folder.path()).unwrap();
    authority.rekey(RobotId(7), None).unwrap();
    let after = authority.save().unwrap().members().clone();
    assert!(after.robots[&RobotId(7)] != before && after.expelled[&RobotId(7)] == before);
}

#[test]
fn no_key_that_was_taken_off_the_roster_ever_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("keys");
    let mut authority = Authority::create(&place, "demo", Roles::NONE).unwrap();
    let (robot, desk) = (Applicant::Robot(RobotId(7)), Applicant::Client("desk".parse().unwrap()));
    let new = |number: u32, who: &Applicant| {
        key_of(&folder.path().join(number.to_string()), who, false).unwrap().public_key()
    };
    let keys: Vec<PublicKey> = (0..3).map(|number| new(number, &robot)).collect();
    authority.enrol(&robot, keys[0], Roles::NONE).unwrap();
    for key in &keys[1..] {
        authority.save().unwrap();
        authority.rekey(RobotId(7), Some(*key)).unwrap();
    }
    let of_desk = new(3, &desk);
    authority.enrol(&desk, of_desk, Roles::NONE).unwrap();
    authority.save().unwrap();
    for who in [&robot, &desk] {
        authority.expel(who).unwrap();
    }
    authority.save().unwrap();
    drop(authority);
    // The roster knows the last key of a robot; the folder all, also where the file was lost as it was before this was kept.
    let mut authority = Authority::open(&place).unwrap();
    for (who, key) in keys.iter().map(|key| (&robot, key)).chain([(&desk, &of_desk)]) {
        let refused = authority.enrol(who, *key, Roles::NONE).unwrap_err().to_string();
        assert!(refused.contains("taken off the roster before"), "{refused}");
    }
    authority.enrol(&robot, new(4, &robot), Roles::NONE).unwrap();
    authority.save().unwrap();
    // A roster from an older copy has such a key: nobody else is enrolled beside it.
    authority.enrol(&desk, new(5, &desk), Roles::NONE).unwrap();
    authority.save().unwrap();
    let older = fs::read(place.join(ROSTER_FILE)).unwrap();
    authority.rekey(RobotId(7), Some(new(6, &robot))).unwrap();
    authority.expel(&desk).unwrap();
    authority.save().unwrap();
    drop(authority);
    fs::write(place.join(ROSTER_FILE), older).unwrap();
    let mut authority = Authority::open(&place).unwrap();
    authority.enrol_here(RobotId(8)).unwrap();
    let refused = authority.save().unwrap_err().to_string();
    assert!(refused.contains("robot 7 is a member with a key that was taken off"), "{refused}");
    // One by one they are none any more.
    drop(authority);
    let mut authority = Authority::open(&place).unwrap();
    authority.expel(&desk).unwrap();
    authority.save().unwrap();
    drop(authority);
    let mut authority = Authority::open(&place).unwrap();
    authority.rekey(RobotId(7), None).unwrap();
    authority.enrol_here(RobotId(8)).unwrap();
    authority.save().unwrap();
    drop(authority);
    fs::write(place.join("revoked.json"), "[").unwrap();
    let refused = Authority::open(&place).map(drop).unwrap_err().to_string();
    assert!(refused.contains("revoked.json") && refused.contains("restore"), "{refused}");
}

#[test]
fn a_folder_that_has_a_swarm_is_left_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    drop(swarm_of(folder.path(), &[7]));
    // The key that may change it was put away.
    fs::remove_file(folder.path().join(AUTHORITY_FILE)).unwrap();
    let refused = Authority::create(folder.path(), "demo", Roles::NONE).map(drop).unwrap_err().to_string();
    assert!(refused.contains("roster.json is there already"), "{refused}");
    let refused = Authority::open_or_create(folder.path(), Some("demo")).map(drop).unwrap_err().to_string();
    assert!(refused.contains("authority.key is not there"), "{refused}");
    assert!(!folder.path().join(AUTHORITY_FILE).exists());
}

#[test]
fn robots_that_are_enrolled_at_once_in_a_new_folder_are_of_one_swarm() {
    for _ in 0..8 {
        let folder = tempfile::tempdir().unwrap();
        let enrol = |robot: u32| {
            let mut authority = Authority::open_or_create(folder.path(), Some("demo")).unwrap();
            authority.enrol_here(RobotId(robot)).unwrap();
            authority.save().unwrap();
        };
        std::thread::scope(|scope| (0..4).for_each(|robot| drop(scope.spawn(move || enrol(robot)))));
        assert_eq!(Authority::open(folder.path()).unwrap().members.robots.len(), 4);
    }
}

#[test]
fn the_old_key_is_there_until_the_roster_has_the_new_one() {
    let folder = tempfile::tempdir().unwrap();
    let (authority, before) = swarm_of(folder.path(), &[7]);
    drop(authority);
    let key = || Identity::read(&key_file(folder.path(), RobotId(7))).unwrap().public_key();
    let trust = TrustSection { keys: Some(folder.path().to_owned()), ..TrustSection::default() };
    let starts = || trust.seal(RobotId(7)).unwrap().unwrap().credentials(RobotId(7)).is_ok();
    // Interrupted before the roster is written, twice.
    for _ in 0..2 {
        Authority::open(folder.path()).unwrap().rekey(RobotId(7), None).unwrap();
        assert!(key() == before.members().robots[&RobotId(7)] && starts());
    }
    let mut authority = Authority::open(folder.path()).unwrap();
    authority.rekey(RobotId(7), None).unwrap();
    let after = authority.save().unwrap();
    assert!(key() == after.members().robots[&RobotId(7)] && key() != before.members().robots[&RobotId(7)]);
    assert!(starts());
    let left = fs::read_dir(folder.path()).unwrap().flatten();
    assert!(left.into_iter().all(|file| !file.file_name().to_string_lossy().contains("new")));
}

#[test]
fn of_keys_that_are_made_at_once_the_one_on_the_roster_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    drop(swarm_of(folder.path(), &[7]));
    let rekey = || {
        let mut authority = Authority::open(folder.path()).unwrap();
        authority.rekey(RobotId(7), None).unwrap();
        authority.save().unwrap();
    };
    std::thread::scope(|scope| (0..4).for_each(|_| drop(scope.spawn(rekey))));
    let roster = Authority::open(folder.path()).unwrap().roster().unwrap();
    let key = Identity::read(&key_file(folder.path(), RobotId(7))).unwrap().public_key();
    assert_eq!((roster.members().epoch, key), (6, roster.members().robots[&RobotId(7)]));
}

#[test]
fn who_was_interrupted_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    // When there was no roster yet.
    new_identity(&folder.path().join(AUTHORITY_FILE)).unwrap();
    let mut authority = Authority::create(folder.path(), "demo", Roles::up_to(Role::Open)).unwrap();
    assert_eq!(authority.roster().unwrap().members().local, Roles::up_to(Role::Open));
    authority.enrol_here(RobotId(7)).unwrap();
    authority.save().unwrap();
    // When the roster had a new key that did not lie in its place yet; then with its certificate in place, and the key not.
    let (new, file) = authority.new_key_file(RobotId(7));
    for is_certificate_there in [false, true] {
        authority.rekey(RobotId(7), None).unwrap();
        authority.new_files.clear();
        authority.save().unwrap();
        if is_certificate_there {
            fs::rename(certificate_file(&new), certificate_file(&file)).unwrap();
        }
        drop(authority);
        authority = Authority::open(folder.path()).unwrap();
        let key = Identity::read(&file).unwrap().public_key();
        assert!(key == authority.members.robots[&RobotId(7)] && !new.exists());
        let trust = TrustSection { keys: Some(folder.path().to_owned()), ..TrustSection::default() };
        assert!(trust.seal(RobotId(7)).unwrap().unwrap().credentials(RobotId(7)).is_ok());
    }
    drop(authority);
    assert!(Authority::create(folder.path(), "demo", Roles::NONE).is_err(), "it has its swarm");
}

#[test]
fn a_key_is_not_taken_away_where_the_roster_stays_what_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let (mut authority, roster) = swarm_of(folder.path(), &[7, 8]);
    let of_eight = roster.members().robots[&RobotId(8)];
    // The card of one was copied for the other.
    authority.rekey(RobotId(7), Some(of_eight)).unwrap();
    assert!(authority.save().unwrap_err().to_string().contains("the same key"));
    drop(authority);
    let mut authority = Authority::open(folder.path()).unwrap();
    authority.enrol_here(RobotId(9)).unwrap();
    authority.save().unwrap();
}
