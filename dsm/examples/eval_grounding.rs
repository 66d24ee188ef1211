//! Measures grounding on a file of scenes and one of queries and writes the predictions:
//! `cargo run --release -p dsm --example eval_grounding SCENES QUERIES PREDICTIONS`.
#![allow(clippy::print_stdout, clippy::disallowed_methods)]

use dsm::eval_grounding::{evaluate, read_queries, read_scenes};
use dsm::ground::{GroundConfig, Grounder};
use dsm::knowledge::Knowledge;
use std::sync::Arc;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let paths: Vec<String> = std::env::args().skip(1).collect();
    let [scenes, queries, predictions] = paths.as_slice() else {
        return Err("usage: eval_grounding SCENES QUERIES PREDICTIONS".into());
    };
    let scenes = read_scenes(&std::fs::read_to_string(scenes)?)?;
    let queries = read_queries(&std::fs::read_to_string(queries)?)?;
    let grounder = Grounder::new(GroundConfig::referring(), Arc::new(Knowledge::embedded()?))?;
    let start = std::time::Instant::now();
    let (answers, report) = evaluate(&scenes, &queries, &grounder, || start.elapsed().as_micros() as u64);
    let lines: Result<Vec<String>, _> = answers.iter().map(serde_json::to_string).collect();
    std::fs::write(predictions, lines?.join("\n") + "\n")?;
    println!("{}", serde_json::to_string_pretty(&report)?);
    Ok(())
}
