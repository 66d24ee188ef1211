//! `dsm suite PATH...` and `dsm suite --generate N`: many episodes, many seeds, one table.

use super::output::{prepare_suite_folder, print, to_json};
use super::run::{catch_interrupt, prepare, run_and_write, set_threads};
use super::scene::write_scene;
use super::suite_done::{Fingerprint, Program, find_done, write_done};
use super::suite_file::SUITE_FILE;
use super::suite_page::write_index;
use super::suite_result::{Suite, SuiteEpisode};
use super::suite_spread::{gather, plan};
use super::{OutArgs, Output, ResultArgs, WorldArgs};
use crate::episode_generator::{Disturb, KINDS, Kind, write_episodes, write_sequences};
use crate::error::TaskError;
use crate::failure_page::{FAILURE_FILE, crash_page};
use crate::run::{RunSpec, Silent};
use crate::settings::Settings;
use crate::summary::Stage;
use dsm::knowledge::Knowledge;
use dsm::store::write_atomically;
use dsm_sim::scene::{Doorways, Furniture, HomeConfig, SceneModel, Semantics, generate_home};
use dsm_sim::world::WorldError;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Episodes that share a generated home.
const EPISODES_PER_HOME: u32 = 4;
/// Rooms of a generated home: this many, or up to two more, by its seed.
const FEWEST_ROOMS: u32 = 4;
/// Objects per room of a generated home.
const OBJECTS_PER_ROOM: u32 = 18;

/// Arguments of `dsm suite`.
#[derive(Debug, clap::Args)]
pub struct SuiteArgs {
    /// Episode files, or folders that are searched for episodes/*.toml.
    #[arg(required_unless_present = "generate", conflicts_with = "generate")]
    paths: Vec<PathBuf>,
    /// Seeds A..B (B excluded); the seed of each episode file when left out.
    #[arg(long, value_name = "A..B", value_parser = parse_seeds, conflicts_with = "generate")]
    seeds: Option<(u64, u64)>,
    /// N episodes in generated homes instead of files, four to a home; home k is made from the seed `--seed` + k. They
    /// begin in an unknown home, but for every other one that only drives: there an `explore` step comes first, and the
    /// drive is weighed from where that ends (`metrics.known_map_spl`, `totals.known_map_spl`).
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    generate: Option<u32>,
    /// Something happens in each generated episode: one kind of `[[disturb]]`, or `all` kinds in turn. Only tasks that it can
    /// happen to are asked for.
    #[arg(long, value_name = "KIND", requires = "generate")]
    disturb: Option<Disturb>,
    /// Sequences of three commands in one sentence instead of single ones.
    #[arg(long, requires = "generate", conflicts_with = "disturb")]
    sequences: bool,
    /// Furniture of the generated homes that opens as real furniture does: bar handles, weight, friction, things inside.
    #[arg(long, requires = "generate")]
    articulated: bool,
    /// Closed doors in the doorways of the generated homes, where a bedroom, bathroom, office or the like begins.
    #[arg(long, requires = "generate")]
    doors: bool,
    /// What the episodes are about, in turn; those that open furniture need `--articulated`, `pass_door` needs `--doors`.
    #[arg(long, value_delimiter = ',', requires = "generate")]
    kinds: Vec<Kind>,
    /// Episodes that run side by side; never changes a result.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=64))]
    workers: u16,
    /// Run nothing: print what is to be run as JSON, and whether it is done already. `python -m dsm.suite` spreads it over
    /// machines; see docs/batch.md.
    #[arg(long, conflicts_with = "gather")]
    plan: bool,
    /// Run nothing: write the report from the episodes that are done below --out and from the lines in this file, a JSON
    /// array of `episodes` as in suite.json, for those that did not come to their end.
    #[arg(long, value_name = "LINES")]
    gather: Option<PathBuf>,
    /// Write a JUnit file; its times are simulated.
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    #[command(flatten)]
    world: WorldArgs,
    /// `--out` may name the folder of a suite that was interrupted: what is done is not run again unless forced.
    #[command(flatten)]
    out: OutArgs,
    #[command(flatten)]
    result: ResultArgs,
}

pub(super) fn parse_seeds(text: &str) -> Result<(u64, u64), String> {
    let expected = || format!("expected A..B with A < B, for example 0..10, got `{text}`");
    let (a, b) = text.split_once("..").ok_or_else(expected)?;
    let (a, b) = (a.trim().parse::<u64>().map_err(|_| expected())?, b.trim().parse::<u64>().map_err(|_| expected())?);
    if a < b && b - a <= 100_000 { Ok((a, b)) } else { Err(expected()) }
}

/// Runs the suite; code 1 when an episode failed.
pub(super) fn run(args: SuiteArgs) -> anyhow::Result<u8> {
    let named = match args.generate {
        Some(_) => Vec::new(),
        None => find_specs(&find_episodes(&args.paths)?, &args)?,
    };
    let folder = prepare_suite_folder(&args.out, Path::new("out/suite"))?;
    let specs = match args.generate {
        Some(count) => generate(count, &folder, &args)?,
        None => named,
    };
    let specs = with_one_language(specs);
    if args.plan {
        print(&to_json(&plan(&specs, &folder, args.out.force))?)?;
        return Ok(0);
    }
    let interrupted = catch_interrupt()?;
    let mut episodes = match &args.gather {
        Some(lines) => gather(&specs, &folder, lines)?,
        None => run_all(&specs, &folder, usize::from(args.workers), args.out.force, &interrupted)?,
    };
    episodes.sort_by(|a, b| (&a.id, a.seed).cmp(&(&b.id, b.seed)));
    let suite = Suite::new(episodes);
    write_atomically(&folder.join(SUITE_FILE), to_json(&suite)?.as_bytes()).map_err(TaskError::from)?;
    write_index(&suite, &folder)?;
    if let Some(path) = &args.junit {
        write_atomically(path, suite.junit().as_bytes()).map_err(TaskError::from)?;
    }
    Output::new(args.result).give(&suite, || suite.table())?;
    if interrupted.load(Ordering::Relaxed) {
        return Ok(130);
    }
    Ok(u8::from(!suite.all_succeed()))
}

/// The runs of episode files; every file is checked before anything is run or written.
fn find_specs(files: &[PathBuf], args: &SuiteArgs) -> Result<Vec<RunSpec>, TaskError> {
    let mut specs: Vec<RunSpec> = Vec::new();
    for file in files {
        let (spec, settings) = prepare(file, &args.world)?;
        if let Some(other) = specs.iter().find(|other| other.name == spec.name) {
            let (one, other) = (other.file.display(), file.display());
            let reason = format!("{one} and {other} have one name, and so one folder in --out; rename one of them");
            return Err(TaskError::Usage(reason));
        }
        set_threads_once(settings.threads.value, specs.is_empty())?;
        crate::assemble::check(&spec)?;
        match args.seeds {
            Some((a, b)) => specs.extend((a..b).map(|seed| RunSpec { seed, ..spec.clone() })),
            None => specs.push(spec),
        }
    }
    Ok(specs)
}

/// One backend of language for all runs, so that its budget is one. It is named by flag or environment, not by episodes.
fn with_one_language(mut specs: Vec<RunSpec>) -> Vec<RunSpec> {
    if let Some(language) = specs.first().map(|spec| spec.language.clone()) {
        specs.iter_mut().for_each(|spec| spec.language = language.clone());
    }
    specs
}

/// Writes generated homes and their episodes below the folder, and returns the runs.
fn generate(count: u32, folder: &Path, args: &SuiteArgs) -> Result<Vec<RunSpec>, TaskError> {
    let knowledge = Knowledge::embedded().map_err(|error| TaskError::Internal(error.to_string()))?;
    let settings = Settings::resolve(&args.world, None, &|_| false)?;
    set_threads(settings.threads.value)?;
    let first = settings.seed.value;
    let furniture = if args.articulated { Furniture::Articulated } else { Furniture::Plain };
    let doorways = if args.doors { Doorways::Doors } else { Doorways::Open };
    let kinds = if args.kinds.is_empty() { &KINDS[..] } else { &args.kinds };
    let mut files: Vec<PathBuf> = Vec::new();
    let mut home = 0;
    while files.len() < count as usize {
        let seed = first.checked_add(home).ok_or_else(|| TaskError::Usage("--seed is too large".into()))?;
        home += 1;
        let rooms = FEWEST_ROOMS + (seed % 3) as u32;
        let config = HomeConfig { seed, rooms, objects: rooms * OBJECTS_PER_ROOM, furniture, doorways };
        let scene = generate_home(&config).map_err(|error| TaskError::Internal(error.to_string()))?;
        let home_folder = folder.join("homes").join(&scene.name);
        write_scene(&scene, &home_folder, true)?;
        let file = home_folder.join("scene.xml");
        let model = SceneModel::load(&file).map_err(WorldError::from)?;
        let semantics = Semantics::load(&file, &model).map_err(WorldError::from)?;
        let left = (count as usize - files.len()).min(EPISODES_PER_HOME as usize);
        let episodes_folder = home_folder.join("episodes");
        std::fs::create_dir_all(&episodes_folder)
            .map_err(|source| TaskError::Read { path: episodes_folder.clone(), source })?;
        let episodes = match args.sequences {
            true => write_sequences(&model, &semantics, &knowledge, seed, left),
            false => write_episodes(&model, &semantics, &knowledge, seed, left, (kinds, args.disturb)),
        };
        for episode in episodes {
            let path = episodes_folder.join(format!("{}.toml", episode.name));
            write_atomically(&path, episode.text.as_bytes())?;
            files.push(path);
        }
        // Not every home has what a disturbance needs.
        if home > 8 * (u64::from(count) + 8) {
            return Err(TaskError::Internal("generated homes hold nothing to do".into()));
        }
    }
    let mut specs = Vec::new();
    for file in &files {
        let (spec, _) = prepare(file, &args.world)?;
        // A home's own seed draws start, placement and noise of its runs.
        specs.push(RunSpec { seed: spec.episode.seed, ..spec });
    }
    Ok(specs)
}

fn set_threads_once(threads: u16, first: bool) -> Result<(), TaskError> {
    if first { set_threads(threads) } else { Ok(()) }
}

/// Episode files named, and those in `episodes` folders below the folders named; sorted.
fn find_episodes(paths: &[PathBuf]) -> Result<Vec<PathBuf>, TaskError> {
    let mut files = Vec::new();
    for path in paths {
        if path.is_dir() {
            collect(path, &mut files)?;
        } else if path.is_file() {
            files.push(path.clone());
        } else {
            return Err(TaskError::Usage(format!("{}: no such file or folder", path.display())));
        }
    }
    files.sort();
    files.dedup();
    if files.is_empty() {
        return Err(TaskError::Usage("no episode found; expected files, or folders that hold episodes/*.toml".into()));
    }
    Ok(files)
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> Result<(), TaskError> {
    let read = |source| TaskError::Read { path: folder.to_owned(), source };
    for entry in std::fs::read_dir(folder).map_err(read)? {
        let path = entry.map_err(read)?.path();
        let in_episodes = folder.file_name().is_some_and(|n| n == "episodes");
        if path.is_dir() {
            collect(&path, files)?;
        } else if in_episodes && path.extension().is_some_and(|e| e == "toml") {
            files.push(path);
        }
    }
    Ok(())
}

fn run_all(
    specs: &[RunSpec],
    folder: &Path,
    workers: usize,
    force: bool,
    interrupted: &Arc<AtomicBool>,
) -> Result<Vec<SuiteEpisode>, TaskError> {
    let program = Program::read();
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::new());
    let bar = ProgressBar::with_draw_target(Some(specs.len() as u64), ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos} of {len} episodes  {elapsed}  {msg}") {
        bar.set_style(style);
    }
    std::thread::scope(|scope| {
        for _ in 0..workers.min(specs.len()) {
            scope.spawn(|| {
                while let Some(spec) = specs.get(next.fetch_add(1, Ordering::Relaxed)) {
                    if interrupted.load(Ordering::Relaxed) {
                        break;
                    }
                    let line = run_one(spec, folder, force, program, interrupted);
                    let word = if line.success { "success" } else { "failed" };
                    bar.set_message(format!("{} seed {}: {word}", line.id, line.seed));
                    bar.inc(1);
                    if let Ok(mut done) = done.lock() {
                        done.push(line);
                    }
                }
            });
        }
    });
    bar.finish_and_clear();
    done.into_inner().map_err(|_| TaskError::Internal("a worker panicked".into()))
}

/// The folder of an episode in that of its suite.
pub(super) fn own_folder(spec: &RunSpec, folder: &Path) -> PathBuf {
    folder.join(format!("{}-{}", spec.name, spec.seed))
}

/// The line of an episode that broke, and its page.
fn crashed(spec: &RunSpec, own: &Path, reason: String) -> SuiteEpisode {
    // The line says what went wrong, whether its page can be written or not.
    let _ = std::fs::create_dir_all(own);
    let _ = write_atomically(&own.join(FAILURE_FILE), crash_page(spec, &reason).as_bytes());
    SuiteEpisode::without_metrics(&spec.name, spec.seed, Stage::Crash, reason)
}

/// Runs one episode, or takes what an earlier suite left of it; whatever goes wrong becomes a line.
fn run_one(
    spec: &RunSpec,
    folder: &Path,
    force: bool,
    program: Program,
    interrupted: &Arc<AtomicBool>,
) -> SuiteEpisode {
    let own = own_folder(spec, folder);
    let fingerprint = Fingerprint::of(spec, program);
    if let (false, Some(fingerprint)) = (force, &fingerprint)
        && let Some(done) = find_done(&own, fingerprint)
    {
        return done;
    }
    // Half a folder of an interrupted suite is replaced.
    let out = OutArgs { out: Some(own.clone()), force: true };
    let result = catch_unwind(AssertUnwindSafe(|| {
        let folder = super::output::prepare_folder(&out, Path::new("."))?;
        run_and_write(spec, &folder, interrupted.clone(), Box::new(Silent))
    }));
    match result {
        Ok(Ok(summary)) => {
            let line = SuiteEpisode::from(summary);
            // An interrupted episode is run again next time.
            if let (false, Some(fingerprint)) = (interrupted.load(Ordering::Relaxed), &fingerprint)
                && let Err(error) = write_done(&own, fingerprint, &line)
            {
                tracing::warn!("{}: cannot be resumed: {error}", own.display());
            }
            line
        }
        Ok(Err(error)) => crashed(spec, &own, error.to_string()),
        Err(panic) => {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("without a message");
            crashed(spec, &own, format!("the episode panicked: {text}"))
        }
    }
}

#[cfg(test)]
mod tests {
    //! Contract: seeds are A..B with A < B.
    use super::*;

    #[test]
    fn seeds_are_a_half_open_range() {
        assert_eq!(parse_seeds("0..10"), Ok((0, 10)));
        for wrong in ["3", "5..5", "9..2", "a..b", "-1..3", "0..999999999"] {
            assert!(parse_seeds(wrong).is_err(), "{wrong}");
        }
    }
}
