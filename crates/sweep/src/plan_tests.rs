//! Tests of plans: which runs there are, how they are called, and what is refused.

use super::*;

const EXPERIMENT: &str = "name = \"sine\"\n[data]\ntask = \"sinusoid\"\nsteps = 40\n[[network.groups]]\nname = \"context\"\nunits = 4\n\
                          time_constant = 2.0\n[training]\nepochs = 10\noptimiser = \"adam\"\n";

fn plan_of(experiment: &str, sweep: &str) -> Result<Plan> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("sine.toml"), experiment).unwrap();
    let path = folder.path().join("s.toml");
    std::fs::write(&path, format!("name = \"s\"\nexperiment = \"sine.toml\"\n{sweep}")).unwrap();
    Plan::read(&path)
}

fn plan(sweep: &str) -> Plan {
    plan_of(EXPERIMENT, sweep).unwrap()
}

fn refused(sweep: &str) -> String {
    format!("{:?}", plan_of(EXPERIMENT, sweep).unwrap_err())
}

fn names(plan: &Plan) -> Vec<&str> {
    plan.settings.iter().map(|setting| setting.name.as_str()).collect()
}

fn folders(plan: &Plan) -> Vec<&str> {
    plan.runs.iter().map(|run| run.folder.as_str()).collect()
}

#[test]
fn a_grid_combines_all_values_and_names_say_what_differs() {
    let plan =
        plan("seeds = 2\n[grid]\n\"training.adam.rate\" = [1e-4, 0.01]\nnetwork.groups.context.units = [3, 4]\n");
    assert_eq!(plan.knobs, ["network.groups.context.units", "training.adam.rate"]);
    assert_eq!(names(&plan), ["units=3,rate=1e-4", "units=3,rate=0.01", "units=4,rate=1e-4", "units=4,rate=0.01"]);
    assert_eq!(
        folders(&plan)[..3],
        ["units=3,rate=1e-4/seed-1", "units=3,rate=1e-4/seed-2", "units=3,rate=0.01/seed-1"]
    );
    let experiment = plan.experiment(&plan.runs[7]).unwrap();
    assert_eq!((experiment.network.groups[0].units, experiment.seed), (4, 2));
    assert_eq!(experiment.training.adam.unwrap().rate, 0.01);
    // Settings take turns.
    assert_eq!(plan.order(), [0, 2, 4, 6, 1, 3, 5, 7]);
}

#[test]
fn a_sweep_of_seeds_alone_has_one_setting() {
    let plan = plan("seeds = [4, 2]\nseeded = [\"seed\", \"data.seed\"]\n");
    assert_eq!(folders(&plan), ["seed-4", "seed-2"]);
    let experiment = plan.experiment(&plan.runs[0]).unwrap();
    assert_eq!((experiment.seed, experiment.data.seed), (4, Some(4)));
}

#[test]
fn draws_are_the_same_everywhere_and_more_begin_with_the_same() {
    let text = |draws: u64, seed: u64| {
        format!(
            "[random]\ndraws = {draws}\nseed = {seed}\n\"training.adam.rate\" = {{ from = 1e-4, to = 1e-1, scale = \"log\" }}\n\
             \"network.groups.context.units\" = {{ from = 2, to = 9 }}\n"
        )
    };
    let (five, eight) = (plan(&text(5, 1)), plan(&text(8, 1)));
    assert_eq!(five.settings[..], eight.settings[..5]);
    assert_ne!(five.settings[0], plan(&text(5, 2)).settings[0]);
    let units: Vec<u64> = eight.settings.iter().map(|one| one.values[0].as_u64().unwrap()).collect();
    assert!(units.iter().all(|units| (2..=9).contains(units)), "{units:?}");
}

#[test]
fn conditions_set_several_keys_and_begin_from_experiments_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.toml"), EXPERIMENT).unwrap();
    std::fs::write(folder.path().join("b.toml"), EXPERIMENT.replace("epochs = 10", "epochs = 20")).unwrap();
    let text = "name = \"s\"\nexperiment = \"a.toml\"\nseeds = 2\n[set]\ntraining.adam.clip_norm = 2.0\n[[conditions]]\nname = \"narrow\"\n\
                [[conditions]]\nname = \"wide\"\nexperiment = \"b.toml\"\nseeds = 1\nset = { \"network.initial_state_variance\" = 0.5 }\n\
                [grid]\n\"network.groups.context.units\" = [3, 5]\n";
    let path = folder.path().join("s.toml");
    std::fs::write(&path, text).unwrap();
    let plan = Plan::read(&path).unwrap();
    assert_eq!(names(&plan), ["narrow,units=3", "narrow,units=5", "wide,units=3", "wide,units=5"]);
    assert_eq!(plan.runs.len(), 6);
    let wide = plan.experiment(&plan.runs[5]).unwrap();
    assert_eq!((wide.training.epochs, wide.network.groups[0].units), (20, 5));
    assert_eq!(wide.network.initial_state_variance, 0.5);
    assert_eq!(wide.training.adam.unwrap().clip_norm, 2.0);
}

#[test]
fn every_seed_is_judged_by_the_same_sequences() {
    let experiment = EXPERIMENT.replace("steps = 40", "steps = 40\nsequences = 6\nheld_out = 0.3");
    let plan = plan_of(&experiment, "seeds = 3\n").unwrap();
    let drawn = HeldOut::Drawn(HeldOutDrawn { share: 0.3, seed: 1 });
    assert!(plan.runs.iter().all(|run| plan.experiment(run).unwrap().data.held_out.as_ref() == Some(&drawn)));
}

#[test]
fn every_key_is_checked_before_anything_is_trained() {
    let told = refused("[grid]\n\"training.adam.rat\" = [1e-3]\n");
    assert!(told.contains("did you mean `rate`"), "{told}");
    let told = refused("[grid]\n\"network.groups.slow.units\" = [3]\n");
    assert!(told.contains("there are `context`"), "{told}");
    let told = refused("[grid]\n\"training.adam.rate\" = [1e-3, -1.0]\n");
    assert!(told.contains("-1"), "{told}");
    let told = refused("[set]\ntraining.momentum.rate = 1e-3\n");
    assert!(told.contains("this has no effect"), "{told}");
    let told = refused("[set]\ntraining.members = 3\n");
    assert!(told.contains("single networks"), "{told}");
    for (twice, place) in [
        ("[set]\nseed = 3\n", "`seeded`"),
        ("[set]\ntraining.epochs = 3\n[grid]\ntraining.epochs = [3]\n", "[grid]"),
        (
            "[grid]\ntraining.epochs = [3]\n[[conditions]]\nname = \"a\"\nset = { \"training.epochs\" = 4 }\n",
            "condition `a`",
        ),
    ] {
        assert!(refused(twice).contains(place), "{twice}: {}", refused(twice));
    }
    let told = refused(
        "[grid]\ntraining.epochs = { from = 1, to = 100000, count = 100000 }\nseed = { from = 1, to = 20, count = 20 }\n",
    );
    assert!(told.contains("at most 1000000") || told.contains("is set by"), "{told}");
}

#[test]
fn names_of_folders_are_safe_and_differ() {
    let mut taken = HashSet::new();
    for (wanted, name) in [
        ("a=x/y", "a=x_y"),
        ("A=x/y", "A=x_y-2"),
        ("../up", "_.._up"),
        ("Report.HTML", "_Report.HTML"),
        ("files=*.csv", "files=_.csv"),
        ("files=*.csv", "files=_.csv-2"),
    ] {
        assert_eq!(unused(wanted, &mut taken), name);
    }
    let (long, other) = ("é".repeat(300), "é".repeat(301));
    let (long, other) = (unused(&long, &mut taken), unused(&other, &mut taken));
    assert!(long.len() <= LONGEST && other.len() <= LONGEST && long != other);
}

#[test]
fn keys_are_called_by_as_little_as_tells_them_apart() {
    let keys = ["network.groups.fast.units", "network.groups.slow.units", "training.adam.rate"].map(String::from);
    assert_eq!(short_names(&keys), ["fast.units", "slow.units", "rate"]);
}

#[test]
fn the_plan_in_the_folder_is_read_back_or_refused() {
    let plan = plan("seeds = 2\n[grid]\ntraining.epochs = [3, 4]\n");
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join(PLAN), plan.listed().text()).unwrap();
    let listed = Listed::read(folder.path()).unwrap();
    assert_eq!(listed.text(), plan.listed().text());
    for (from, to) in [("epochs=3/seed-1", "../seed-1"), ("\"setting\":1", "\"setting\":7"), ("{", "")] {
        std::fs::write(folder.path().join(PLAN), plan.listed().text().replacen(from, to, 1)).unwrap();
        assert_eq!(Listed::read(folder.path()).unwrap_err().code(), 2, "{from}");
    }
    assert!(
        Listed::read(&folder.path().join("none")).unwrap_err().to_string().contains("is not the folder of a sweep")
    );
}

#[test]
fn a_finished_run_counts_only_while_the_sweep_asks_for_the_same() {
    let decided = |text: &str| {
        let plan = plan(text);
        plan.decided_by(&plan.runs[0]).unwrap()
    };
    let first = decided("");
    assert_eq!(first, decided("seeds = 4\n[then]\nmeasures = [\"nll\"]\n"));
    for other in ["[set]\ntraining.epochs = 11\n", "[then.generate]\n", "[then]\nbest = true\n", "seeds = [2]\n"] {
        assert_ne!(first, decided(other), "{other}");
    }
}
