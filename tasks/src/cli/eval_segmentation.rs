//! `dsm eval segmentation`: a map against any labelled cloud, by the paper's protocol for Replica.

use super::{Output, ResultArgs};
use crate::error::TaskError;
use crate::language::{EMBEDDED, LanguageCost, find_language, tell_cost};
use dsm::eval::{AnsweredLabeller, CloudScore, LabelClasses, LabelledCloud, Labeller, Question, describe, score_cloud};
use dsm::map::Map;
use dsm::store::{load_map, write_atomically};
use serde::Serialize;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Arguments of `dsm eval segmentation`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = FORMS)]
pub struct SegmentationArgs {
    /// A map file, in the frame of the cloud.
    map: PathBuf,
    /// The labelled cloud: PLY, ASCII or binary little endian.
    #[arg(long, value_name = "FILE")]
    truth: PathBuf,
    /// What the labels mean, and which are background: TOML.
    #[arg(long, value_name = "FILE")]
    classes: PathBuf,
    /// Integer property of the cloud that holds the label.
    #[arg(long, value_name = "NAME", default_value = "label")]
    label_property: String,
    /// Write what a language backend is asked about each object, one JSON object a line: object_id, sentence, classes.
    #[arg(long, value_name = "FILE")]
    questions: Option<PathBuf>,
    /// Take each object's class from the answers of a language backend, one JSON object a line: object_id, class. Without
    /// it the embedded text encoder chooses.
    #[arg(long, value_name = "FILE")]
    answers: Option<PathBuf>,
    /// Who chooses the classes: `embedded`, or a file of models, which needs the feature `models`.
    #[arg(long, value_name = "embedded|FILE", default_value = EMBEDDED, conflicts_with = "answers")]
    backend: String,
    #[command(flatten)]
    result: ResultArgs,
}

/// Shown below the long help.
const FORMS: &str = "\
The cloud: `element vertex N` first, with x, y, z (float or double, metres), the label (any integer type) and, if \
points stand for unequal surfaces, area (float, square metres). Other properties and elements are read over.

The classes:
  version = 1
  [[class]]
  label = 20
  name = \"chair\"
  [[class]]
  label = 93
  name = \"wall\"
  exclude = true   # background: its points are left out, and no object can be one

Every stable object of the map gets one class that is not excluded; every point of the cloud takes the class of the \
nearest map point within 25 cm, or none. mAcc is the mean over the classes of the share of their surface with the \
right class, F-mIoU that of intersection over union. Classes without a point in the cloud do not count. \
`dsm scene labels` writes both files for a scene of one's own.";

/// The result.
#[derive(Serialize)]
struct Scored {
    #[serde(flatten)]
    score: CloudScore,
    /// What a model has cost.
    #[serde(skip_serializing_if = "Option::is_none")]
    cost: Option<LanguageCost>,
}

/// Measures; code 0 once it has measured.
pub(super) fn run(args: SegmentationArgs) -> anyhow::Result<u8> {
    let map = load_map(&args.map).map_err(TaskError::from)?.map;
    let classes = LabelClasses::parse(&read_text(&args.classes)?, &args.classes).map_err(TaskError::from)?;
    let bytes = std::fs::read(&args.truth).map_err(|source| TaskError::Read { path: args.truth.clone(), source })?;
    let truth = LabelledCloud::parse(&bytes, &args.truth, &args.label_property)
        .map_err(|error| TaskError::Usage(error.to_string()))?;
    if let Some(path) = &args.questions {
        write_atomically(path, questions(&map, &classes)?.as_bytes()).map_err(TaskError::from)?;
    }
    let wrong = |path: &Path| {
        let path = path.display().to_string();
        move |error| TaskError::Usage(format!("{path}: {error}"))
    };
    let language = find_language(&args.backend)?;
    let (mut labeller, source): (Box<dyn Labeller>, &Path) = match &args.answers {
        Some(path) => (Box::new(AnsweredLabeller::parse(&read_text(path)?).map_err(wrong(path))?), path),
        None => (language.labeller()?, &args.truth),
    };
    let score = score_cloud(&map, &truth, &classes, labeller.as_mut()).map_err(wrong(source))?;
    let scored = Scored { score, cost: language.cost() };
    Output::new(args.result).give(&scored, || tell(&scored.score) + &tell_cost(scored.cost.as_ref()))?;
    Ok(0)
}

fn read_text(path: &Path) -> Result<String, TaskError> {
    std::fs::read_to_string(path).map_err(|source| TaskError::Read { path: path.to_owned(), source })
}

fn questions(map: &Map, classes: &LabelClasses) -> Result<String, TaskError> {
    let mut names: Vec<&str> = classes.classes.iter().filter(|c| !c.exclude).map(|c| c.name.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    let mut text = String::new();
    for object in map.stable_objects() {
        let question = Question { object_id: object.id, sentence: describe(object), classes: &names };
        text += &serde_json::to_string(&question).map_err(|error| TaskError::Internal(error.to_string()))?;
        text.push('\n');
    }
    Ok(text)
}

fn tell(score: &CloudScore) -> String {
    let mut text = String::new();
    let percent = |share: f64| 100.0 * share;
    let _ = writeln!(
        text,
        "mAcc {:.2} %, F-mIoU {:.2} %, IoU by surface {:.2} %; {} classes, {} points, {} objects, classes by {}",
        percent(score.mean_accuracy),
        percent(score.mean_iou),
        percent(score.weighted_iou),
        score.classes.len(),
        score.points,
        score.objects.len(),
        score.labeller
    );
    let (unreached, excluded, unlisted) = (score.unreached_points, score.excluded_points, score.unlisted_points);
    let _ = writeln!(
        text,
        "{unreached} points farther than 25 cm from the map; left out: {excluded} of excluded classes, {unlisted} of \
         labels that no class lists"
    );
    let listed = |names: &[String]| if names.is_empty() { "none".to_owned() } else { names.join(", ") };
    let _ = writeln!(text, "excluded: {}; not in the cloud: {}", listed(&score.excluded), listed(&score.absent));
    let _ = writeln!(text, "  {:<24} {:>8} {:>8} {:>8}", "class", "points", "acc %", "IoU %");
    for class in &score.classes {
        let (accuracy, iou) = (percent(class.accuracy), percent(class.iou));
        let _ = writeln!(text, "  {:<24} {:>8} {accuracy:>8.2} {iou:>8.2}", class.name, class.points);
    }
    text
}
