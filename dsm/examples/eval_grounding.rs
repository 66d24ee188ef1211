//! Measures grounding on a file of scenes and one of queries and writes the predictions:
//! `cargo run --release -p dsm --example eval_grounding SCENES QUERIES PREDICTIONS`.
#![allow(clippy::print_stdout, clippy::disallowed_methods)]

use dsm::eval_grounding::{cross_validate, evaluate, fit_all, read_queries, read_scenes, write_weights};
use dsm::ground::{GroundConfig, Grounder};
use dsm::knowledge::Knowledge;
use std::sync::Arc;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let paths: Vec<String> = std::env::args().skip(1).collect();
    let scenes = read_scenes(&std::fs::read_to_string(&paths[0])?)?;
    let queries = read_queries(&std::fs::read_to_string(&paths[1])?)?;
    let knowledge = Arc::new(Knowledge::embedded()?);
    let grounder = Grounder::new(GroundConfig::referring(), knowledge.clone())?;
    let start = std::time::Instant::now();
    let now = || start.elapsed().as_micros() as u64;
    let (answers, report) = evaluate(&scenes, &queries, &grounder, now);
    let show = |report: &dsm::eval_grounding::Report| {
        for (k, r) in &report.rates {
            if !k.contains("sr3d/") {
                println!("{k:<34} {:.2} {}", r.percent, r.count);
            }
        }
    };
    println!("shipped weights, {:?}", report.time_us);
    show(&report);
    let lines: Result<Vec<String>, _> = answers.iter().map(serde_json::to_string).collect();
    std::fs::write(&paths[2], lines?.join("\n") + "\n")?;
    let make = |weights| Grounder::new(GroundConfig::referring(), knowledge.clone()).unwrap().with_weights(weights);
    let (held, report) = cross_validate(&scenes, &queries, 5, make, now);
    println!("held out");
    show(&report);
    let lines: Result<Vec<String>, _> = held.iter().map(serde_json::to_string).collect();
    std::fs::write(paths[2].clone() + ".cv", lines?.join("\n") + "\n")?;
    let fitted = fit_all(&scenes, &queries, &grounder);
    std::fs::write(paths[2].clone() + ".rs", write_weights(&fitted))?;
    let (_, report) = evaluate(&scenes, &queries, &make(fitted), now);
    println!("fitted on all");
    show(&report);
    if let Some(path) = paths.get(3) {
        use std::io::Write;
        let mut out = std::io::BufWriter::new(std::fs::File::create(path)?);
        for q in &queries {
            let s = &scenes[&q.scene_id];
            let r = grounder.rank_evidence(&s.import(), &s.fronts(), &q.utterance);
            let a = grounder.ground_with_fronts(&s.import(), &s.fronts(), &q.utterance, None);
            let ids: Vec<u64> = r.ids.iter().map(|i| i.0).collect();
            writeln!(out, "{}", serde_json::json!({"q": q.query_id, "ids": ids, "rows": r.rows, "query": a.query}))?;
        }
    }
    println!("{:.1} s", start.elapsed().as_secs_f64());
    Ok(())
}
