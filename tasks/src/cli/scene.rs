//! `dsm scene`: generate, import, label, check and survey.

use super::output::prepare_scene_folder;
use super::scene_survey::{self, SurveyArgs};
use super::{Output, ResultArgs};
use crate::error::TaskError;
use dsm::store::write_atomically;
use dsm_sim::replay::label_surfaces;
use dsm_sim::scene::{
    Doorways, Furniture, GeneratedScene, HomeConfig, ImportError, Located, RobotSize, SceneNote, check_scene,
    generate_home, import_ithor, summarise_notes,
};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Commands on scenes.
#[derive(Debug, clap::Subcommand)]
pub enum SceneCommand {
    /// Generate a furnished home of several rooms; the same seed gives the same bytes.
    Generate {
        /// Seed of everything that is drawn.
        #[arg(long, default_value_t = 0)]
        seed: u64,
        /// Rooms, 1 to 12.
        #[arg(long, default_value_t = 5)]
        rooms: u32,
        /// Objects, 10 to 600: furniture and the things on it.
        #[arg(long, default_value_t = 90)]
        objects: u32,
        /// Furniture that can be opened: bar handles, doors and drawers with weight and friction, things in some drawers. All
        /// else is as without.
        #[arg(long)]
        articulated: bool,
        /// Closed doors with bar handles, on hinges, in the doorways of bedrooms, bathrooms and where one works. All else is as
        /// without.
        #[arg(long)]
        doors: bool,
        #[command(flatten)]
        target: Target,
        #[command(flatten)]
        result: ResultArgs,
    },
    /// Import a floor plan of AI2-THOR: one room, nothing movable, receptacles hollow, colours by the seed.
    Import {
        /// The layout, a JSON file with `scene_id` and `objects`.
        layout: PathBuf,
        /// Seed of the colours.
        #[arg(long, default_value_t = 0)]
        seed: u64,
        #[command(flatten)]
        target: Target,
        #[command(flatten)]
        result: ResultArgs,
    },
    /// Write the visible surface of a scene as a labelled cloud (labelled.ply) and what its labels mean (classes.toml): the
    /// truth for `dsm eval segmentation`. Things lie where a run with this seed finds them.
    Labels {
        /// A scene: its folder or its MJCF file.
        scene: PathBuf,
        /// Seed of the placements.
        #[arg(long, default_value_t = 0)]
        seed: u64,
        /// Folder of the two files.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
        /// Write the cloud as text instead of binary.
        #[arg(long)]
        ascii: bool,
        #[command(flatten)]
        result: ResultArgs,
    },
    /// Look for interpenetration, falling objects, rooms that cannot be reached and names that do not fit; code 1 when
    /// something is found.
    Check {
        /// A scene: its folder or its MJCF file.
        scene: PathBuf,
        #[command(flatten)]
        result: ResultArgs,
    },
    /// Try MJCF files: load each, leave it to itself for a second, draw a frame; say what works, what fails and why, and
    /// what is done otherwise than written. Code 1 when a file that is a model fails.
    Survey(SurveyArgs),
}

/// Where a scene is written to.
#[derive(Debug, clap::Args)]
pub struct Target {
    /// Folder of the scene.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Replace a scene that is there already.
    #[arg(long)]
    force: bool,
}

#[derive(Serialize)]
struct SceneReport {
    scene: String,
    bodies: usize,
    free_bodies: usize,
    jointed_bodies: usize,
    categories: usize,
    held_joints: usize,
    notes: Vec<SceneNote>,
    findings: Vec<Located>,
}

#[derive(Serialize)]
struct LabelsReport {
    cloud: PathBuf,
    class_file: PathBuf,
    points: usize,
    classes: usize,
}

#[derive(Serialize)]
struct WrittenReport {
    scene: String,
    folder: PathBuf,
    rooms: usize,
    objects: usize,
    categories: usize,
}

/// Runs a command on scenes.
pub(super) fn run(command: SceneCommand) -> anyhow::Result<u8> {
    match command {
        SceneCommand::Generate { seed, rooms, objects, articulated, doors, target, result } => {
            let furniture = if articulated { Furniture::Articulated } else { Furniture::Plain };
            let doorways = if doors { Doorways::Doors } else { Doorways::Open };
            let made = generate_home(&HomeConfig { seed, rooms, objects, furniture, doorways });
            write(&made.map_err(|error| TaskError::Usage(error.to_string()))?, &target, result)
        }
        SceneCommand::Import { layout, seed, target, result } => write(&import(&layout, seed)?, &target, result),
        SceneCommand::Labels { scene, seed, out, ascii, result } => labels(&scene, seed, &out, ascii, result),
        SceneCommand::Check { scene, result } => check(&scene, result),
        SceneCommand::Survey(args) => scene_survey::run(args),
    }
}

/// Reads a layout of AI2-THOR.
pub(super) fn import(layout: &Path, seed: u64) -> Result<GeneratedScene, TaskError> {
    let read = |source| TaskError::Read { path: layout.to_owned(), source };
    let text = std::fs::read_to_string(layout).map_err(read)?;
    let wrong = |error| match error {
        ImportError::Format { line, reason } => format!("{}:{line}: {reason}", layout.display()),
        other => format!("{}: {other}", layout.display()),
    };
    import_ithor(&text, seed).map_err(|error| TaskError::Usage(wrong(error)))
}

fn write(scene: &GeneratedScene, target: &Target, result: ResultArgs) -> anyhow::Result<u8> {
    write_scene(scene, &target.out, target.force)?;
    let report = WrittenReport {
        scene: scene.name.clone(),
        folder: target.out.clone(),
        rooms: scene.rooms,
        objects: scene.objects,
        categories: scene.categories,
    };
    Output::new(result).give(&report, || {
        let folder = report.folder.display();
        format!("{folder}: {} rooms, {} objects of {} categories", report.rooms, report.objects, report.categories)
    })?;
    Ok(0)
}

/// Writes the files of a scene; `scene.xml` last, so that a scene that is there is whole.
pub(super) fn write_scene(scene: &GeneratedScene, folder: &Path, force: bool) -> Result<(), TaskError> {
    prepare_scene_folder(folder, force)?;
    for (name, bytes) in scene.files.iter().rev() {
        let path = folder.join(name);
        if let Some(parent) = path.parent() {
            std::fs::create_dir_all(parent).map_err(|source| TaskError::Read { path: parent.to_owned(), source })?;
        }
        write_atomically(&path, bytes)?;
    }
    Ok(())
}

fn labels(scene: &Path, seed: u64, out: &Path, ascii: bool, result: ResultArgs) -> anyhow::Result<u8> {
    let (cloud, classes) = label_surfaces(scene, seed).map_err(TaskError::from)?;
    std::fs::create_dir_all(out).map_err(|source| TaskError::Read { path: out.to_owned(), source })?;
    let report = LabelsReport {
        cloud: out.join("labelled.ply"),
        class_file: out.join("classes.toml"),
        points: cloud.points.len(),
        classes: classes.classes.len(),
    };
    write_atomically(&report.class_file, classes.to_toml().as_bytes())?;
    write_atomically(&report.cloud, &cloud.to_ply(!ascii))?;
    Output::new(result).give(&report, || {
        format!("{}: {} points of {} classes", report.cloud.display(), report.points, report.classes)
    })?;
    Ok(0)
}

fn check(scene: &Path, result: ResultArgs) -> anyhow::Result<u8> {
    let checked = check_scene(scene, RobotSize::default()).map_err(TaskError::from)?;
    let held_joints = checked.held_joints().count();
    let report = SceneReport {
        scene: checked.name,
        bodies: checked.bodies,
        free_bodies: checked.free_bodies,
        jointed_bodies: checked.jointed_bodies,
        categories: checked.categories,
        held_joints,
        notes: checked.notes,
        findings: checked.findings,
    };
    let found = !report.findings.is_empty();
    Output::new(result).give(&report, || {
        let mut text = format!(
            "{}: {} bodies, {} of them free, {} on joints, {} categories\n",
            report.scene, report.bodies, report.free_bodies, report.jointed_bodies, report.categories
        );
        for note in summarise_notes(&report.notes) {
            text.push_str(&format!("  note: {note}\n"));
        }
        for finding in &report.findings {
            text.push_str(&format!("  {finding}\n"));
        }
        text.push_str(if found { "" } else { "nothing to complain about\n" });
        text
    })?;
    Ok(u8::from(found))
}
