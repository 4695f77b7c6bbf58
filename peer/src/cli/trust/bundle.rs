//! What a member takes away from its enrolment: the roster and its certificate, none of it a secret; and the files of a client.

use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use gestalt_link::{Certificate, Credentials};
use gestalt_trust::{Applicant, Identity, Roster, RosterError};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::sync::Arc;

use super::super::Failure;
use super::folder::said;
use super::keys::{holder, key_path};
use crate::config::{ROSTER_FILE, certificate_file};

const BEGIN: &str = "-----BEGIN GESTALT MEMBERSHIP-----";
const END: &str = "-----END GESTALT MEMBERSHIP-----";

/// The longest block accepted: the largest roster, in base64, and what is around it.
pub(super) const MAX_BLOCK: u64 = 1 << 20;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Block {
    robot: Option<gestalt_protocol::RobotId>,
    client: Option<gestalt_protocol::InstructorId>,
    roster: String,
    certificate: String,
}

/// The block that a new member accepts.
pub(super) fn block(who: &Applicant, roster: &Roster, certificate: &Certificate) -> Result<String, Failure> {
    let (robot, client) = match who {
        Applicant::Robot(robot) => (Some(*robot), None),
        Applicant::Client(name) => (None, Some(name.clone())),
    };
    let block = Block { robot, client, roster: roster.to_json(), certificate: certificate.to_pem() };
    let text = STANDARD.encode(serde_json::to_vec(&block)?);
    let lines: Vec<&str> =
        text.as_bytes().chunks(76).map(|line| str::from_utf8(line).unwrap_or_default()).collect();
    Ok(format!("{BEGIN}\n{}\n{END}", lines.join("\n")))
}

/// Takes up a block: who is a member by it, and of which roster. Nothing is written unless all of it fits.
///
/// # Errors
/// A block that is none, is of another swarm than the one enrolled in before, or for a key that is not here.
pub(super) fn accept(folder: &Path, text: &str) -> Result<(Applicant, Roster), Failure> {
    let whole = || {
        Failure::from(
            "no membership: copy all of what `gestalt trust enrol` prints, with its first and last line",
        )
    };
    let (_, rest) = text.split_once(BEGIN).ok_or_else(whole)?;
    let (body, _) = rest.split_once(END).ok_or_else(whole)?;
    let bytes = STANDARD.decode(body.split_whitespace().collect::<String>()).map_err(|_| whole())?;
    let block: Block = serde_json::from_slice(&bytes).map_err(|_| whole())?;
    let who = match (block.robot, block.client) {
        (Some(robot), None) => Applicant::Robot(robot),
        (None, Some(name)) => Applicant::Client(name),
        _ => return Err(whole()),
    };
    let offered: Roster = Roster::parse(block.roster.as_bytes())?;
    let certificate = Certificate::parse(&block.certificate)?;
    let key = key_path(folder, &who);
    if !key.exists() {
        let name = said(&who);
        return Err(format!(
            "{} is not there: this membership is for {name}, with the key of its request",
            key.display()
        )
        .into());
    }
    let identity = Identity::read(&key)?;
    certificate.check(&offered, holder(&who), &identity.public_key())?;
    let is_member = |roster: &Roster| roster.members().key(&who) == Some(identity.public_key());
    if !is_member(&offered) {
        return Err(format!(
            "{} is not on this roster with the key that it has here: ask for the newest",
            said(&who)
        )
        .into());
    }
    let file = folder.join(ROSTER_FILE);
    let held: Option<Roster> = if file.exists() { Some(Roster::read(&file)?) } else { None };
    let (roster, is_new) = match held {
        None => (offered, true),
        Some(held) => match held.successor(block.roster.as_bytes()) {
            // Somebody else was enrolled since, and this folder knows it: whoever is a member there as well needs the certificate alone.
            Err(RosterError::Older { .. }) if is_member(&held) => (held, false),
            other => other?.map_or((held, false), |newer| (newer, true)),
        },
    };
    if is_new {
        roster.write(&file)?;
    }
    certificate.write(&certificate_file(&key))?;
    Ok((who, roster))
}

/// Writes all that a client needs into a folder of its own: its certificate, the roster, and Zenoh's configuration, which any Zenoh client opens.
///
/// # Errors
/// Files that cannot be written.
pub(super) fn write_client(
    folder: &Path,
    name: &gestalt_protocol::InstructorId,
    identity: Identity,
    roster: &Roster,
    certificate: Certificate,
) -> Result<(), Failure> {
    let who = Applicant::Client(name.clone());
    roster.write(&folder.join(ROSTER_FILE))?;
    certificate.write(&certificate_file(&key_path(folder, &who)))?;
    let credentials = Credentials::new(roster, holder(&who), Arc::new(identity), certificate)?;
    let config = json!({
        "mode": "client",
        "connect": {"endpoints": ["tls/127.0.0.1:7447"]},
        "scouting": {"multicast": {"enabled": false}},
        "transport": {"link": {"tls": credentials.tls()}},
    });
    let text = format!(
        "// What any Zenoh client needs to be let in to the swarm \"{}\" as {name}. It holds {name}'s key: keep it to yourself.\n\
         // Name the endpoint of a robot under connect.\n{config:#}\n",
        roster.members().swarm
    );
    let file = folder.join("zenoh.json5");
    gestalt_file::replace_secret(&file, text.as_bytes())
        .map_err(|error| format!("cannot write {}: {error}", file.display()).into())
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::RobotId;
    use gestalt_trust::{Request, Role, Roles};

    use super::super::folder::Authority;
    use super::super::keys::key_of;
    use super::*;

    /// What a robot prints, and what whoever has the authority's key answers.
    fn enrolled(of_robot: &Path, authority: &mut Authority, robot: u32) -> String {
        let who = Applicant::Robot(RobotId(robot));
        let line = Request::new(who, &key_of(of_robot, &Applicant::Robot(RobotId(robot)), false).unwrap())
            .to_string();
        let request: Request = line.parse().unwrap();
        authority.enrol(&request.applicant, request.key, Roles::NONE).unwrap();
        let certificate = authority.certify(&request.applicant, &request.key).unwrap();
        block(&request.applicant, &authority.save().unwrap(), &certificate).unwrap()
    }

    #[test]
    fn a_robot_is_enrolled_by_one_line_there_and_one_block_back() {
        let folder = tempfile::tempdir().unwrap();
        let (there, here) = (folder.path().join("robot"), folder.path().join("desk"));
        let mut authority = Authority::create(&here, "demo", Roles::NONE).unwrap();
        let block = enrolled(&there, &mut authority, 7);
        let (who, roster) = accept(&there, &format!("pasted:\n{block}\n")).unwrap();
        assert_eq!((who, roster.members().swarm.as_str()), (Applicant::Robot(RobotId(7)), "demo"));
        let trust = crate::config::TrustSection { keys: Some(there.clone()), ..Default::default() };
        assert!(trust.seal(RobotId(7)).unwrap().unwrap().credentials(RobotId(7)).is_ok());
        assert!(!here.join("robot-7.key").exists(), "the key never left the robot");

        // The block of another one, of an older epoch, of another swarm.
        let other = enrolled(&folder.path().join("other"), &mut authority, 8);
        assert!(accept(&there, &other).unwrap_err().to_string().contains("robot-8.key"));
        // One of the same folder that was enrolled before the other was accepted: its roster is older, and it is a member of the newer one.
        let [first, second] = [9, 10].map(|robot| enrolled(&there, &mut authority, robot));
        let (_, newer) = accept(&there, &second).unwrap();
        assert_eq!(accept(&there, &first).unwrap(), (Applicant::Robot(RobotId(9)), newer.clone()));
        assert!(trust.seal(RobotId(9)).unwrap().unwrap().credentials(RobotId(9)).is_ok());
        authority.rekey(RobotId(7), None).unwrap();
        let (_, newer) = accept(&there, &enrolled(&there, &mut authority, 10)).unwrap();
        assert!(
            accept(&there, &block).unwrap_err().to_string().contains("older"),
            "its key is believed no more"
        );
        assert_eq!(Roster::<gestalt_trust::Ed25519>::read(&there.join(ROSTER_FILE)).unwrap(), newer);
        let mut elsewhere = Authority::create(&folder.path().join("elsewhere"), "demo", Roles::NONE).unwrap();
        let usurped = enrolled(&there, &mut elsewhere, 7);
        assert!(
            accept(&there, &usurped).unwrap_err().to_string().contains("another swarm or another authority")
        );
        for bad in ["", &block[1..], &block[..block.len() - 1], &block.replace("A", "B")] {
            assert!(accept(&there, bad).is_err());
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_clients_files_are_its_owners_alone() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let mut authority = Authority::create(folder.path(), "demo", Roles::NONE).unwrap();
        let desk: gestalt_protocol::InstructorId = "desk".parse().unwrap();
        let who = Applicant::Client(desk.clone());
        let own = folder.path().join("client-desk");
        let identity = key_of(&own, &who, false).unwrap();
        let key = identity.public_key();
        authority.enrol(&who, key, Roles::up_to(Role::Teach)).unwrap();
        let certificate = authority.certify(&who, &key).unwrap();
        let roster = authority.save().unwrap();
        write_client(&own, &desk, identity, &roster, certificate).unwrap();
        for file in ["client-desk.key", "zenoh.json5"] {
            let mode = std::fs::metadata(own.join(file)).unwrap().permissions().mode();
            assert_eq!(mode & 0o777, 0o600, "{file}");
        }
        let text = std::fs::read_to_string(own.join("zenoh.json5")).unwrap();
        assert!(zenoh::Config::from_json5(&text).is_ok(), "{text}");
        let trust = crate::config::TrustSection { keys: Some(own), ..Default::default() };
        assert!(format!("{:?}", trust.credentials(RobotId(1)).unwrap().unwrap()).contains("client desk"));
    }
}
