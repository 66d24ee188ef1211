//! The model of a robot: `robot.toml` and its URDF, forward kinematics, Jacobians, shapes and self-collision.
//!
//! ```text
//! robot.toml ───────────────┐
//!                           ├─▶ RobotModel ─▶ root_from_links, jacobian, collision distances
//! robot.urdf, attachments ──┘
//! ```

mod boxes;
pub mod collision;
mod holding;
pub mod kinematics;
pub mod obstacle;
pub mod ros2;
pub mod settings;
pub mod shapes;
mod urdf;

pub use collision::{CollisionModel, Other, PairDistance};
pub use kinematics::{Configuration, Drive, Group, JointKind, JointLimits, Kinematics, LinkId, LinkPoses};
pub use obstacle::{Hull, Obstacle};
pub use settings::RobotSettings;

use crate::joints::{JointNames, JointPositions};
use dsm::Pose;
use dsm::config::{ConfigError, find_nearest, line_of};
use nalgebra::Vector3;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use thiserror::Error;

/// Why a robot could not be loaded.
#[derive(Debug, Error, PartialEq)]
pub enum ModelError {
    /// `robot.toml` is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A file cannot be read.
    #[error("{}: cannot be read: {reason}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// The operating system's words.
        reason: String,
    },
    /// The URDF is wrong.
    #[error("{}:{line}: {message}", file.display())]
    Urdf {
        /// The file.
        file: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong and what was expected.
        message: String,
    },
    /// `robot.toml` and the URDF do not fit each other.
    #[error("{}:{line}: {message}", file.display())]
    Mismatch {
        /// `robot.toml`.
        file: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong and what was expected.
        message: String,
    },
}

/// Everything that is known about a robot. Poses are in the base frame, which is the URDF's root link.
#[derive(Clone, Debug)]
pub struct RobotModel {
    /// `robot.toml`.
    pub settings: RobotSettings,
    /// The file `robot.toml`.
    pub file: PathBuf,
    /// Links and joints.
    pub kinematics: Kinematics,
    /// The arm with its lift.
    pub arm: Group,
    /// The head.
    pub head: Group,
    /// The fingers.
    pub gripper: Group,
    /// All groups, the three above included.
    pub groups: Vec<Group>,
    /// The frame that grasps.
    pub tool: LinkId,
    /// Shapes for collision checks.
    pub collision: Arc<CollisionModel>,
}

impl RobotModel {
    /// Loads `robot.toml` (given itself or its folder), its URDF and its meshes, and checks them against each other.
    pub fn load(folder_or_file: &Path) -> Result<Self, ModelError> {
        let file = if folder_or_file.is_dir() { folder_or_file.join("robot.toml") } else { folder_or_file.to_owned() };
        let text = std::fs::read_to_string(&file)
            .map_err(|error| ModelError::Unreadable { file: file.clone(), reason: error.to_string() })?;
        let settings: RobotSettings = dsm::config::parse_toml(&text, &file)?;
        let fit = Fit { file: &file, text: &text };
        let urdfs = fit.find_urdfs(&settings)?;
        let mut kinematics = Kinematics::load_urdf_parts(&urdfs, &settings.locked_joints)?;
        for name in &settings.locked_joints {
            if kinematics.find_joint(name).is_none() {
                let known: Vec<&str> = kinematics.joints.iter().map(|joint| joint.name.as_str()).collect();
                return Err(fit.unknown("joint", name, &known));
            }
        }
        for name in &settings.collision.ignored_links {
            let link = fit.link(&kinematics, name)?;
            kinematics.links[link.0].collisions.clear();
        }
        for camera in &settings.camera {
            fit.mount(&mut kinematics, camera)?;
        }
        fit.assemble(settings, kinematics)
    }

    /// Links that the arm group moves.
    pub fn arm_links(&self) -> Vec<LinkId> {
        self.kinematics.links_moved_by(&self.arm)
    }

    /// The signs with which the joints of the head, pan then tilt, take angles to the left and downwards: whichever way
    /// their axes point.
    pub fn head_signs(&self) -> [f64; 2] {
        let poses = self.kinematics.root_from_links(&self.kinematics.zero());
        // Turning about +z goes left, turning about +y goes from ahead downwards.
        let mut signs = [Vector3::z(), Vector3::y()].map(|direction| (direction, 1.0));
        for ((direction, sign), name) in signs.iter_mut().zip(self.head.joints.iter()) {
            let Some(joint) = self.kinematics.find_joint(name) else { continue };
            let axis = poses.get(joint.child).rotation * joint.axis.into_inner();
            *sign = if axis.dot(direction) < 0.0 { -1.0 } else { 1.0 };
        }
        signs.map(|(_, sign)| sign)
    }

    /// A named posture of `robot.toml`, with the joints that it names.
    pub fn find_posture(&self, name: &str) -> Option<JointPositions> {
        let posture = self.settings.postures.get(name)?;
        let names: JointNames = posture.keys().map(|joint| Arc::from(joint.as_str())).collect();
        JointPositions::from_values(&names, posture.values().copied().collect())
    }

    /// A group by name.
    pub fn find_group(&self, name: &str) -> Option<&Group> {
        self.groups.iter().find(|group| group.name == name)
    }

    /// The settings and the frame of a camera.
    pub fn find_camera(&self, name: &str) -> Option<(&settings::CameraSettings, LinkId)> {
        let camera = self.settings.camera.iter().find(|camera| camera.name == name)?;
        Some((camera, self.kinematics.find_link(&camera.frame)?))
    }

    /// The configuration with every finger opened to half of `width_m` and all else from `configuration`.
    pub fn with_gripper_width(&self, mut configuration: Configuration, width_m: f64) -> Configuration {
        let share = width_m / self.gripper.len() as f64;
        for (variable, limits) in self.gripper.variables.iter().zip(&self.gripper.limits) {
            configuration.set(*variable, share.clamp(limits.lower, limits.upper));
        }
        configuration
    }
}

/// The script beside a `robot.toml` that gets what may not ship with it.
const FETCH: &str = "fetch.sh";

/// Checks of `robot.toml` against the URDF.
struct Fit<'a> {
    file: &'a Path,
    text: &'a str,
}

impl Fit<'_> {
    /// An error at the first line that holds `word` in quotes or as a key.
    fn mismatch(&self, word: &str, message: String) -> ModelError {
        let offset = self.text.find(&format!("\"{word}\"")).or_else(|| self.text.find(word)).unwrap_or(0);
        ModelError::Mismatch { file: self.file.to_owned(), line: line_of(self.text, offset), message }
    }

    fn unknown(&self, what: &str, name: &str, known: &[&str]) -> ModelError {
        let near = find_nearest(name, known.iter().copied())
            .map_or_else(|| format!("; valid: {}", known.join(", ")), |near| format!("; did you mean `{near}`?"));
        self.mismatch(name, format!("there is no {what} `{name}`{near}"))
    }

    /// The robot's URDFs, which must be there.
    fn find_urdfs(&self, settings: &RobotSettings) -> Result<Vec<PathBuf>, ModelError> {
        let folder = self.file.parent().unwrap_or(Path::new("."));
        let find = |(key, name): (&str, &String)| {
            let urdf = folder.join(name);
            if urdf.is_file() {
                return Ok(urdf);
            }
            let script = folder.join(FETCH);
            let hint = if script.is_file() {
                format!("; `{}` gets what this robot needs from elsewhere", script.display())
            } else {
                String::new()
            };
            Err(self.mismatch(name, format!("`{key}` is \"{name}\", which does not exist beside this file{hint}")))
        };
        let attached = settings.attachments.iter().map(|name| ("attachments", name));
        std::iter::once(("urdf", &settings.urdf)).chain(attached).map(find).collect()
    }

    fn link(&self, kinematics: &Kinematics, name: &str) -> Result<LinkId, ModelError> {
        kinematics.find_link(name).ok_or_else(|| {
            let known: Vec<&str> = kinematics.links.iter().map(|link| link.name.as_str()).collect();
            self.unknown("link", name, &known)
        })
    }

    /// Moves the frame of a camera to where the camera really is.
    fn mount(&self, kinematics: &mut Kinematics, camera: &settings::CameraSettings) -> Result<(), ModelError> {
        let offset = camera.frame_from_camera();
        let link = self.link(kinematics, &camera.frame)?;
        if offset == Pose::identity() {
            return Ok(());
        }
        let is_fixed = |joint: &usize| kinematics.joints[*joint].kind == JointKind::Fixed;
        let Some(joint) = kinematics.links[link.0].parent_joint.filter(is_fixed) else {
            let message = format!("`{}` has an offset; expected a frame that a fixed joint carries", camera.frame);
            return Err(self.mismatch(&camera.frame, message));
        };
        kinematics.joints[joint].parent_from_joint *= offset;
        Ok(())
    }

    fn group(&self, kinematics: &Kinematics, settings: &settings::GroupSettings) -> Result<Group, ModelError> {
        let known: Vec<&str> = kinematics.variables.iter().map(|name| &**name).collect();
        if settings.max_accelerations.len() != settings.joints.len() {
            let message = format!(
                "group `{}` has {} joints and {} max_accelerations; expected one for each",
                settings.name,
                settings.joints.len(),
                settings.max_accelerations.len()
            );
            return Err(self.mismatch(&settings.name, message));
        }
        let mut group = Group {
            name: settings.name.clone(),
            joints: settings.joints.iter().map(|joint| Arc::from(joint.as_str())).collect(),
            variables: Vec::new(),
            limits: Vec::new(),
            max_accelerations: settings.max_accelerations.clone(),
        };
        for name in &settings.joints {
            let variable =
                known.iter().position(|v| v == name).ok_or_else(|| self.unknown("moving joint", name, &known))?;
            if group.variables.contains(&variable) {
                return Err(self.mismatch(name, format!("joint `{name}` stands twice in group `{}`", settings.name)));
            }
            let limits = kinematics.find_joint(name).map(|joint| joint.limits);
            let limits = limits.filter(|limits| limits.velocity.is_finite()).ok_or_else(|| {
                self.mismatch(name, format!("joint `{name}` has no velocity limit in the URDF; expected one > 0"))
            })?;
            group.variables.push(variable);
            group.limits.push(limits);
        }
        Ok(group)
    }

    fn assemble(&self, settings: RobotSettings, kinematics: Kinematics) -> Result<RobotModel, ModelError> {
        let base = self.link(&kinematics, &settings.base.link)?;
        if base != kinematics.root {
            let root = &kinematics.links[kinematics.root.0].name;
            let message = format!("base.link is `{}`; expected the URDF's root link `{root}`", settings.base.link);
            return Err(self.mismatch(&settings.base.link, message));
        }
        let mut groups = Vec::with_capacity(settings.group.len());
        for group in &settings.group {
            groups.push(self.group(&kinematics, group)?);
        }
        let group_named = |name: &str| {
            let known: Vec<&str> = groups.iter().map(|group| group.name.as_str()).collect();
            let found = groups.iter().find(|group| group.name == name).cloned();
            found.ok_or_else(|| {
                self.mismatch("[[group]]", format!("there is no group `{name}`; found: {}", known.join(", ")))
            })
        };
        let (arm, head, gripper) = (group_named("arm")?, group_named("head")?, group_named("gripper")?);
        let tool = self.link(&kinematics, &settings.tool.frame)?;
        for joint in &settings.gripper.joints {
            if !gripper.joints.iter().any(|known| **known == **joint) {
                let known: Vec<&str> = gripper.joints.iter().map(|name| &**name).collect();
                return Err(self.unknown("joint of group `gripper`", joint, &known));
            }
        }
        for link in &settings.gripper.finger_links {
            self.link(&kinematics, link)?;
        }
        for camera in &settings.camera {
            self.link(&kinematics, &camera.frame)?;
        }
        self.check_postures(&settings, &kinematics)?;
        self.check_roles(&settings)?;
        self.check_safety(&settings)?;
        let mut ignored = Vec::with_capacity(settings.collision.ignored_pairs.len());
        for [first, second] in &settings.collision.ignored_pairs {
            ignored.push((self.link(&kinematics, first)?, self.link(&kinematics, second)?));
        }
        let collision = Arc::new(CollisionModel::new(&kinematics, &ignored));
        let file = self.file.to_owned();
        Ok(RobotModel { settings, file, kinematics, arm, head, gripper, groups, tool, collision })
    }

    /// Borders that hold something in.
    fn check_safety(&self, settings: &RobotSettings) -> Result<(), ModelError> {
        let safety = &settings.safety;
        if (1..3).contains(&safety.area.len()) || !safety.area.iter().flatten().all(|value| value.is_finite()) {
            return Err(self.mismatch("area", "safety.area: expected three corners or more, each [x, y]".into()));
        }
        if safety.tool_lowest_m.zip(safety.tool_highest_m).is_some_and(|(lowest, highest)| lowest >= highest) {
            return Err(
                self.mismatch("tool_lowest_m", "safety.tool_lowest_m: expected less than tool_highest_m".into())
            );
        }
        Ok(())
    }

    /// What the skills ask a robot for by name.
    fn check_roles(&self, settings: &RobotSettings) -> Result<(), ModelError> {
        let lacks = |what: &str, name: &str, why: &str| {
            self.mismatch("version", format!("there is no {what} `{name}`, which the skills need: {why}"))
        };
        for (name, why) in settings::POSTURES {
            if !settings.postures.contains_key(name) {
                return Err(lacks("posture", name, why));
            }
        }
        let (name, why) = settings::UNFOLDING;
        if settings.paths.get(name).is_none_or(|path| path.len() < 2) {
            return Err(lacks("path of two postures or more", name, why));
        }
        for (name, why) in settings::CAMERAS {
            if !settings.camera.iter().any(|camera| camera.name == name) {
                return Err(lacks("camera", name, why));
            }
        }
        Ok(())
    }

    fn check_postures(&self, settings: &RobotSettings, kinematics: &Kinematics) -> Result<(), ModelError> {
        let known: Vec<&str> = kinematics.variables.iter().map(|name| &**name).collect();
        for (name, posture) in &settings.postures {
            for (joint, value) in posture {
                let limits = kinematics
                    .find_joint(joint)
                    .filter(|_| known.contains(&joint.as_str()))
                    .ok_or_else(|| self.unknown("moving joint", joint, &known))?
                    .limits;
                if !(limits.lower..=limits.upper).contains(value) {
                    let expected = format!("[{}, {}]", limits.lower, limits.upper);
                    let message = format!("posture `{name}` sets `{joint}` to {value}; expected {expected}");
                    return Err(self.mismatch(&format!("postures.{name}"), message));
                }
            }
        }
        for (path, postures) in &settings.paths {
            let known: Vec<&str> = settings.postures.keys().map(String::as_str).collect();
            if let Some(posture) = postures.iter().find(|posture| !known.contains(&posture.as_str())) {
                return Err(self.unknown(&format!("posture (of path `{path}`)"), posture, &known));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
