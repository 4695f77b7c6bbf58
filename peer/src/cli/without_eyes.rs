//! The program without OpenCV: which verbs it lacks, and what to do about it.

use clap::error::{ContextKind, ContextValue, ErrorKind};

/// The verbs that look at pictures.
const LACKING: [&str; 9] =
    ["peer", "stream", "center", "swarm", "capture", "train", "evaluate", "look", "views"];

/// What to say of a command line that asks for a verb which other builds have; `None` for any other mistake.
pub(super) fn explain(error: &clap::Error) -> Option<String> {
    let Some(ContextValue::String(verb)) = error.get(ContextKind::InvalidSubcommand) else { return None };
    let lacks = error.kind() == ErrorKind::InvalidSubcommand && LACKING.contains(&verb.as_str());
    lacks.then(|| {
        format!(
            "this gestalt was built without OpenCV, which '{verb}' needs: build it with its default features (README.md, \"A first robot in five minutes\")"
        )
    })
}

#[cfg(test)]
mod tests {
    use clap::{CommandFactory, Parser};

    use crate::cli::Command;

    #[test]
    fn a_verb_that_other_builds_have_is_explained() {
        for verb in super::LACKING {
            let error = Command::try_parse_from(["gestalt", verb, "--id", "3"]).unwrap_err();
            assert!(super::explain(&error).unwrap().contains(verb), "{error}");
        }
        let typo = Command::try_parse_from(["gestalt", "wach"]).unwrap_err();
        assert_eq!(super::explain(&typo), None);
        // Those that are left run without eyes.
        let left: Vec<_> =
            Command::command().get_subcommands().map(|verb| verb.get_name().to_owned()).collect();
        let needed =
            ["watch", "teach", "record", "replay", "emulate", "doctor", "verify", "keys", "ros", "config"];
        assert!(needed.iter().all(|verb| left.iter().any(|name| name == verb)), "{left:?}");
    }
}
