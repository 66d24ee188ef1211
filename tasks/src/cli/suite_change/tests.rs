//! Contract: pairs are made by name and seed alone; changes are told in both directions; figures come from the same
//! episodes on both sides; the sign test is the exact one.
use super::*;
use crate::cli::suite_result::Suite;

fn line(id: &str, seed: u64, stage: Option<Stage>, sim_time_s: f64) -> SuiteEpisode {
    SuiteEpisode {
        success: stage.is_none(),
        failed_stage: stage,
        reason: stage.map(|_| "it slipped".to_owned()),
        metrics: Some(Metrics { sim_time_s, collisions: 1, ..Metrics::default() }),
        ..SuiteEpisode::without_metrics(id, seed, Stage::Crash, String::new())
    }
}

fn folder(name: &str, episodes: Vec<SuiteEpisode>) -> SuiteFolder {
    SuiteFolder { folder: name.into(), suite: Suite::new(episodes) }
}

fn two() -> [SuiteFolder; 2] {
    let hold = Some(Stage::Hold);
    let a = vec![
        line("a", 0, None, 10.0),
        line("a", 1, None, 20.0),
        line("a", 2, hold, 30.0),
        line("a", 3, hold, 40.0),
        line("only a", 0, None, 1.0),
    ];
    let b = vec![
        line("a", 0, None, 14.0),
        line("a", 1, hold, 20.0),
        line("a", 2, None, 30.0),
        line("a", 3, Some(Stage::Grasp), 40.0),
        line("a", 9, None, 1.0),
    ];
    [folder("first", a), folder("second", b)]
}

#[test]
fn changes_are_told_in_both_directions() {
    let [a, b] = two();
    let there = Comparison::of(&a, &b);
    let back = Comparison::of(&b, &a);
    let told = |c: &Comparison| c.changes.iter().map(|e| (e.seed, e.change)).collect::<Vec<_>>();
    assert_eq!(told(&there), [(1, Change::Worse), (2, Change::Better), (3, Change::OtherStage)]);
    assert_eq!(told(&back), [(2, Change::Worse), (1, Change::Better), (3, Change::OtherStage)]);
    assert_eq!((there.a.shared.count, there.a.shared.of, there.a.all.count, there.a.all.of), (2, 4, 3, 5));
    assert_eq!(there.failed_stages["hold"], [2, 1]);
    assert_eq!(there.failed_stages["grasp"], [0, 1]);
    assert_eq!(there.only_in_a, [Unpaired { id: "only a".into(), seed: 0 }]);
    assert_eq!(there.only_in_b, [Unpaired { id: "a".into(), seed: 9 }]);
    let table = there.table();
    for part in ["worse       a ", "success -> hold", "hold -> grasp", "1 only in A, 1 only in B"] {
        assert!(table.contains(part), "{part} is missing in {table}");
    }
}

#[test]
fn figures_come_from_the_same_episodes() {
    let [a, b] = two();
    let figures = Comparison::of(&a, &b).figures;
    let time = Figure { name: "simulated time where both succeed, s", a: 10.0, b: 14.0, of: 1 };
    let collisions = Figure { name: "collisions", a: 4.0, b: 4.0, of: 4 };
    assert!(figures.contains(&time) && figures.contains(&collisions), "{figures:?}");
    assert!(!figures.iter().any(|figure| figure.name.starts_with("SPL")), "nothing has an SPL");
}

#[test]
fn a_suite_beside_itself_has_no_change() {
    let [a, _] = two();
    let same = Comparison::of(&a, &a);
    assert_eq!((same.identical, same.better, same.worse, same.other_stage), (5, 0, 0, 0));
    assert_eq!((same.sign_test_p, same.changes.len()), (1.0, 0));
}

#[test]
fn the_sign_test_is_exact() {
    // Values from R: binom.test(1, 8)$p.value, binom.test(0, 5)$p.value, binom.test(400, 900)$p.value.
    for ((better, worse), p) in [((1, 7), 0.070_312_5), ((5, 0), 0.0625), ((3, 3), 1.0)] {
        assert!((sign_test(better, worse) - p).abs() < 1e-9, "{better} and {worse}");
    }
    let large = sign_test(400, 500);
    assert!((large - 9.564_441e-4).abs() < 1e-8, "{large}");
}
