//! Every attack of the table, with a few seeds: each comes to what its line says.

use gestalt_attack::run;
use gestalt_trials::{Load, Trial};

fn main() -> std::process::ExitCode {
    let trials = gestalt_attack::all().into_iter().map(|attack| {
        let name = format!("{} {} {}: {}", attack.number, attack.setting, attack.tier, attack.what);
        Trial::new(&name, Load::Works, &[], move || {
            if let Err(error) = attack.check(&run(&attack, 3)) {
                panic!("{error}");
            }
        })
    });
    gestalt_trials::run(trials.collect())
}
