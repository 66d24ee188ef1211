//! Reading URDFs: `urdf-rs` parses, this file resolves files and checks the tree, with the line of what is wrong.

use super::ModelError;
use super::kinematics::{Drive, Inertial, Joint, JointKind, JointLimits, Kinematics, Link, LinkId};
use super::shapes::{CollisionShape, Geometry, Mesh, VisualShape};
use crate::joints::JointNames;
use dsm::Pose;
use nalgebra::{Matrix3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use urdf_rs::JointType;

impl Kinematics {
    /// Loads a URDF with its meshes.
    ///
    /// `package://name/rest` is looked up as `name/rest` in every folder above the file. Floating, planar and
    /// spherical joints are errors, as are xacro files, missing meshes, loops and links that hang on nothing.
    pub fn load_urdf(file: &Path) -> Result<Self, ModelError> {
        Self::load_urdf_parts(&[file.to_owned()], &[])
    }

    /// Loads several URDFs as one robot: joints of one may hang on links of another. The joints of `locked` are fixed
    /// at 0.
    pub fn load_urdf_parts(files: &[PathBuf], locked: &[String]) -> Result<Self, ModelError> {
        let read = |file: &PathBuf| match std::fs::read_to_string(file) {
            Ok(text) => Ok(Source { file: file.clone(), text }),
            Err(error) => Err(ModelError::Unreadable { file: file.clone(), reason: error.to_string() }),
        };
        let sources: Vec<Source> = files.iter().map(read).collect::<Result<_, _>>()?;
        Reader { sources: &sources, meshes: BTreeMap::new() }.read(locked)
    }
}

/// One URDF file.
struct Source {
    file: PathBuf,
    text: String,
}

impl Source {
    fn invalid(&self, line: usize, message: String) -> ModelError {
        ModelError::Urdf { file: self.file.clone(), line, message }
    }

    /// The line of the first element `tag` whose `attribute` is `value`.
    fn find_line(&self, tag: &str, attribute: &str, value: &str) -> Option<usize> {
        let document = roxmltree::Document::parse(&self.text).ok()?;
        let found = document.descendants().find(|n| n.has_tag_name(tag) && n.attribute(attribute) == Some(value))?;
        Some(document.text_pos_at(found.range().start).row as usize)
    }

    /// The XML, when it is that of a plain URDF.
    fn parse(&self) -> Result<roxmltree::Document<'_>, ModelError> {
        let document = roxmltree::Document::parse(&self.text)
            .map_err(|error| self.invalid(error.pos().row as usize, format!("not well-formed XML: {error}")))?;
        let xacro = document.root_element().namespaces().any(|n| n.uri().contains("xacro"))
            && self.text.contains("<xacro:")
            || self.file.extension().is_some_and(|e| e == "xacro");
        if xacro {
            let message = "this is a xacro file; expected a plain URDF (run the xacro tool first)".to_owned();
            return Err(self.invalid(1, message));
        }
        if !document.root_element().has_tag_name("robot") {
            let found = document.root_element().tag_name().name();
            return Err(self.invalid(1, format!("the root element is <{found}>; expected <robot>")));
        }
        Ok(document)
    }
}

/// The colour of a visual without material: URDF leaves it open.
const DEFAULT_RGBA: [f64; 4] = [0.6, 0.6, 0.62, 1.0];

/// Names of links and joints that are taken: the file and line of each.
type Taken<'a> = BTreeMap<(String, String), (&'a Path, usize)>;

struct Reader<'a> {
    sources: &'a [Source],
    meshes: BTreeMap<(PathBuf, [u64; 3]), Arc<Mesh>>,
}

impl<'a> Reader<'a> {
    /// An error at the first element `tag` with this name.
    fn invalid_at(&self, tag: &str, name: &str, message: String) -> ModelError {
        let found = self.sources.iter().find_map(|source| Some((source, source.find_line(tag, "name", name)?)));
        let (source, line) = found.unwrap_or((&self.sources[0], 1));
        source.invalid(line, message)
    }

    fn read(mut self, locked: &[String]) -> Result<Kinematics, ModelError> {
        let sources = self.sources;
        let (mut name, mut links, mut joints, mut taken) = (String::new(), Vec::new(), Vec::new(), Taken::new());
        for source in sources {
            check_elements(source, &source.parse()?, &mut taken)?;
            let robot = urdf_rs::read_from_string(&source.text).map_err(|e| source.invalid(1, e.to_string()))?;
            // A material may be defined once, anywhere, and then only be named.
            let of_visuals = robot.links.iter().flat_map(|link| &link.visual).filter_map(|v| v.material.as_ref());
            let palette: BTreeMap<&str, [f64; 4]> = (robot.materials.iter())
                .chain(of_visuals)
                .filter_map(|material| Some((material.name.as_str(), *material.color.as_ref()?.rgba)))
                .collect();
            for link in &robot.links {
                links.push(self.read_link(source, link, &palette)?);
            }
            joints.extend(robot.joints);
            if name.is_empty() {
                name = robot.name;
            }
        }
        for joint in joints.iter_mut().filter(|joint| locked.contains(&joint.name)) {
            joint.joint_type = JointType::Fixed;
        }
        let (joints, variables) = self.read_joints(&joints, &mut links)?;
        // `connect` made sure that there is exactly one root.
        let root = LinkId(links.iter().position(|link| link.parent_joint.is_none()).unwrap_or(0));
        Ok(Kinematics { name, links, joints, root, variables })
    }

    fn read_link(
        &mut self,
        source: &Source,
        link: &urdf_rs::Link,
        palette: &BTreeMap<&str, [f64; 4]>,
    ) -> Result<Link, ModelError> {
        let mut collisions = Vec::with_capacity(link.collision.len());
        for collision in &link.collision {
            let geometry = self.read_geometry(source, &collision.geometry)?;
            collisions.push(CollisionShape { link_from_shape: to_pose(&collision.origin), geometry });
        }
        let mut visuals = Vec::with_capacity(link.visual.len());
        for visual in &link.visual {
            let rgba = visual.material.as_ref().and_then(|material| {
                material.color.as_ref().map(|color| *color.rgba).or_else(|| palette.get(&*material.name).copied())
            });
            visuals.push(VisualShape {
                link_from_shape: to_pose(&visual.origin),
                geometry: self.read_geometry(source, &visual.geometry)?,
                rgba: rgba.unwrap_or(DEFAULT_RGBA).map(|channel| channel as f32),
            });
        }
        let i = &link.inertial.inertia;
        let inertial = Inertial {
            link_from_inertial: to_pose(&link.inertial.origin),
            mass_kg: link.inertial.mass.value,
            inertia_kg_m2: Matrix3::new(i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz),
        };
        Ok(Link { name: link.name.clone(), parent_joint: None, inertial, collisions, visuals })
    }

    fn read_geometry(&mut self, source: &Source, geometry: &urdf_rs::Geometry) -> Result<Geometry, ModelError> {
        Ok(match geometry {
            urdf_rs::Geometry::Box { size } => Geometry::Box { size_m: Vector3::from(**size) },
            urdf_rs::Geometry::Cylinder { radius, length } => {
                Geometry::Cylinder { radius_m: *radius, length_m: *length }
            }
            urdf_rs::Geometry::Capsule { radius, length } => Geometry::Capsule { radius_m: *radius, length_m: *length },
            urdf_rs::Geometry::Sphere { radius } => Geometry::Sphere { radius_m: *radius },
            urdf_rs::Geometry::Mesh { filename, scale } => {
                let scale = scale.map_or([1.0; 3], |s| *s);
                Geometry::Mesh(self.read_mesh(source, filename, scale)?)
            }
        })
    }

    fn read_mesh(&mut self, source: &Source, name: &str, scale: [f64; 3]) -> Result<Arc<Mesh>, ModelError> {
        let line = source.find_line("mesh", "filename", name).unwrap_or(1);
        let path = find_file(&source.file, name).ok_or_else(|| {
            source.invalid(line, format!("mesh `{name}` does not exist (looked in the folders above the URDF)"))
        })?;
        let key = (path.clone(), scale.map(f64::to_bits));
        if let Some(known) = self.meshes.get(&key) {
            return Ok(known.clone());
        }
        let scene = mesh_loader::Loader::default()
            .load(&path)
            .map_err(|error| source.invalid(line, format!("mesh `{name}` cannot be read: {error}")))?;
        let mut mesh = Mesh { file: path, vertices: Vec::new(), triangles: Vec::new() };
        for part in &scene.meshes {
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend(part.vertices.iter().map(|v| {
                Point3::new(f64::from(v[0]) * scale[0], f64::from(v[1]) * scale[1], f64::from(v[2]) * scale[2])
            }));
            mesh.triangles.extend(part.faces.iter().map(|face| face.map(|corner| corner + first)));
        }
        if mesh.triangles.is_empty() {
            return Err(source.invalid(line, format!("mesh `{name}` holds no triangles")));
        }
        let mesh = Arc::new(mesh);
        self.meshes.insert(key, mesh.clone());
        Ok(mesh)
    }

    fn read_joints(&self, urdf: &[urdf_rs::Joint], links: &mut [Link]) -> Result<(Vec<Joint>, JointNames), ModelError> {
        let link_named = |joint: &urdf_rs::Joint, name: &str| {
            let found = links.iter().position(|link| link.name == name).map(LinkId);
            found.ok_or_else(|| {
                let near = dsm::config::find_nearest(name, links.iter().map(|link| link.name.as_str()))
                    .map_or_else(String::new, |near| format!("; did you mean `{near}`?"));
                self.invalid_at(
                    "joint",
                    &joint.name,
                    format!("joint `{}` names link `{name}`, which does not exist{near}", joint.name),
                )
            })
        };
        let mut joints = Vec::with_capacity(urdf.len());
        for joint in urdf {
            let invalid = |message: String| self.invalid_at("joint", &joint.name, message);
            let kind = match joint.joint_type {
                JointType::Fixed => JointKind::Fixed,
                JointType::Revolute => JointKind::Revolute,
                JointType::Continuous => JointKind::Continuous,
                JointType::Prismatic => JointKind::Prismatic,
                ref other => {
                    let message = format!(
                        "joint `{}` is {other:?}; expected fixed, revolute, continuous or prismatic",
                        joint.name
                    );
                    return Err(invalid(message));
                }
            };
            let axis = Vector3::from(*joint.axis.xyz);
            let axis = match Unit::try_new(axis, 1e-9) {
                Some(axis) => axis,
                None if kind == JointKind::Fixed => Vector3::x_axis(),
                None => return Err(invalid(format!("the axis of joint `{}` is zero", joint.name))),
            };
            joints.push(Joint {
                name: joint.name.clone(),
                kind,
                parent: link_named(joint, &joint.parent.link)?,
                child: link_named(joint, &joint.child.link)?,
                parent_from_joint: to_pose(&joint.origin),
                axis,
                limits: self.read_limits(joint, kind)?,
                drive: Drive::Fixed,
                damping: joint.dynamics.as_ref().map_or(0.0, |dynamics| dynamics.damping),
            });
        }
        self.connect(urdf, links, joints)
    }

    fn read_limits(&self, joint: &urdf_rs::Joint, kind: JointKind) -> Result<JointLimits, ModelError> {
        let limit = &joint.limit;
        let or_infinite = |value: f64| if value > 0.0 { value } else { f64::INFINITY };
        let (lower, upper) = match kind {
            JointKind::Fixed => (0.0, 0.0),
            JointKind::Continuous => (f64::NEG_INFINITY, f64::INFINITY),
            JointKind::Revolute | JointKind::Prismatic => (limit.lower, limit.upper),
        };
        if lower > upper {
            let message = format!("joint `{}` has lower limit {lower} above its upper limit {upper}", joint.name);
            return Err(self.invalid_at("joint", &joint.name, message));
        }
        let (velocity, effort) = (or_infinite(limit.velocity), or_infinite(limit.effort));
        Ok(JointLimits { lower, upper, velocity, effort })
    }

    /// Orders joints parents first and gives every moving joint its variable.
    fn connect(
        &self,
        urdf: &[urdf_rs::Joint],
        links: &mut [Link],
        mut joints: Vec<Joint>,
    ) -> Result<(Vec<Joint>, JointNames), ModelError> {
        let mut carried = vec![false; links.len()];
        for joint in &joints {
            if std::mem::replace(&mut carried[joint.child.0], true) {
                let child = &links[joint.child.0].name;
                return Err(self.invalid_at(
                    "joint",
                    &joint.name,
                    format!("link `{child}` is the child of two joints"),
                ));
            }
        }
        let mut reached: Vec<bool> = carried.iter().map(|carried| !carried).collect();
        if reached.iter().filter(|root| **root).count() != 1 {
            let roots: Vec<&str> =
                links.iter().zip(&reached).filter(|(_, root)| **root).map(|(link, _)| link.name.as_str()).collect();
            let message = format!("expected one root link, found {}: {}", roots.len(), roots.join(", "));
            return Err(self.sources[0].invalid(1, message));
        }
        let mut ordered = Vec::with_capacity(joints.len());
        while !joints.is_empty() {
            let Some(next) = joints.iter().position(|joint| reached[joint.parent.0]) else {
                let name = &joints[0].name;
                return Err(self.invalid_at("joint", name, format!("joint `{name}` is part of a loop")));
            };
            let joint = joints.remove(next);
            reached[joint.child.0] = true;
            links[joint.child.0].parent_joint = Some(ordered.len());
            ordered.push(joint);
        }
        let mimic_of = |name: &str| urdf.iter().find(|j| j.name == name).and_then(|j| j.mimic.as_ref());
        let mut variables: Vec<String> = Vec::new();
        for joint in ordered.iter().filter(|j| j.kind != JointKind::Fixed && mimic_of(&j.name).is_none()) {
            variables.push(joint.name.clone());
        }
        for joint in ordered.iter_mut().filter(|joint| joint.kind != JointKind::Fixed) {
            let (mut master, mut multiplier, mut offset) = (joint.name.clone(), 1.0, 0.0);
            // A mimic may follow a mimic; more hops than joints means that they follow each other.
            for _ in 0..=urdf.len() {
                let Some(mimic) = mimic_of(&master) else { break };
                offset += multiplier * mimic.offset.unwrap_or(0.0);
                multiplier *= mimic.multiplier.unwrap_or(1.0);
                master.clone_from(&mimic.joint);
            }
            let variable = variables.iter().position(|name| *name == master).ok_or_else(|| {
                self.invalid_at(
                    "joint",
                    &joint.name,
                    format!("joint `{}` mimics `{master}`, which is no moving joint", joint.name),
                )
            })?;
            joint.drive = Drive::Variable { variable, multiplier, offset };
        }
        Ok((ordered, variables.into_iter().map(Arc::from).collect()))
    }
}

/// What urdf-rs would report without a line, or not at all: missing attributes, bad numbers, names that stand twice.
fn check_elements<'a>(
    source: &'a Source,
    document: &roxmltree::Document<'_>,
    taken: &mut Taken<'a>,
) -> Result<(), ModelError> {
    for node in document.root_element().children().filter(|n| n.has_tag_name("link") || n.has_tag_name("joint")) {
        let (kind, name) = (node.tag_name().name(), node.attribute("name").unwrap_or_default());
        let line = document.text_pos_at(node.range().start).row as usize;
        if let Some((file, first)) = taken.insert((kind.to_owned(), name.to_owned()), (&source.file, line)) {
            let place = if *file == *source.file { String::new() } else { format!(" of {}", file.display()) };
            let message = format!("{kind} `{name}` stands already in line {first}{place}; expected a unique name");
            return Err(source.invalid(line, message));
        }
    }
    for node in document.descendants().filter(roxmltree::Node::is_element) {
        let line = document.text_pos_at(node.range().start).row as usize;
        let needed: &[&str] = match node.tag_name().name() {
            "link" if node.parent_element().is_some_and(|p| p.has_tag_name("robot")) => &["name"],
            "joint" if node.parent_element().is_some_and(|p| p.has_tag_name("robot")) => &["name", "type"],
            "parent" | "child" if node.parent_element().is_some_and(|p| p.has_tag_name("joint")) => &["link"],
            "mesh" => &["filename"],
            "mimic" => &["joint"],
            _ => &[],
        };
        for attribute in needed {
            if node.attribute(*attribute).is_none_or(str::is_empty) {
                let tag = node.tag_name().name();
                return Err(source.invalid(line, format!("<{tag}> has no `{attribute}`")));
            }
        }
        for attribute in node.attributes() {
            let (count, low, bound) = match attribute.name() {
                "xyz" | "rpy" => (3, f64::NEG_INFINITY, ""),
                "lower" | "upper" => (1, f64::NEG_INFINITY, ""),
                "size" if node.has_tag_name("box") => (3, 0.0, " >= 0"),
                "radius" | "length" | "velocity" | "effort" => (1, 0.0, " >= 0"),
                _ => continue,
            };
            let numbers: Vec<_> = attribute.value().split_whitespace().map(str::parse::<f64>).collect();
            let fits = |n: &Result<f64, _>| n.as_ref().is_ok_and(|v| v.is_finite() && *v >= low);
            if numbers.len() != count || !numbers.iter().all(fits) {
                let message = format!(
                    "`{}` is \"{}\"; expected {count} finite number{}{bound}",
                    attribute.name(),
                    attribute.value(),
                    if count == 1 { "" } else { "s" }
                );
                return Err(source.invalid(line, message));
            }
        }
    }
    Ok(())
}

/// A file that a URDF names.
fn find_file(urdf: &Path, name: &str) -> Option<PathBuf> {
    let folder = urdf.parent().unwrap_or(Path::new("."));
    if let Some(inside) = name.strip_prefix("package://") {
        let folder = folder.canonicalize().ok()?;
        return folder.ancestors().map(|above| above.join(inside)).find(|path| path.is_file());
    }
    let path = folder.join(name.strip_prefix("file://").unwrap_or(name));
    path.is_file().then_some(path)
}

fn to_pose(pose: &urdf_rs::Pose) -> Pose {
    let ([x, y, z], [roll, pitch, yaw]) = (*pose.xyz, *pose.rpy);
    Pose::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_euler_angles(roll, pitch, yaw))
}
