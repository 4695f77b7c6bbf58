//! Every attack of the table, with a few seeds: each comes to what its line says.

use gestalt_trials::{Load, Trial, run};

fn main() -> std::process::ExitCode {
    let trials = gestalt_attack::all().into_iter().map(|attack| {
        let name = format!("{} {} {}: {}", attack.number, attack.setting, attack.tier, attack.what);
        Trial::new(&name, Load::Works, &[], move || {
            if let Err(error) = attack.check(&attack.run(3)) {
                panic!("{error}");
            }
        })
    });
    run(trials.collect())
}
