//! Reading a URDF: `urdf-rs` parses, this file resolves files and checks the tree, with the line of what is wrong.

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
        let text = std::fs::read_to_string(file)
            .map_err(|error| ModelError::Unreadable { file: file.to_owned(), reason: error.to_string() })?;
        Reader { file, text: &text, meshes: BTreeMap::new() }.read()
    }
}

struct Reader<'a> {
    file: &'a Path,
    text: &'a str,
    meshes: BTreeMap<(PathBuf, [u64; 3]), Arc<Mesh>>,
}

impl Reader<'_> {
    fn invalid(&self, line: usize, message: String) -> ModelError {
        ModelError::Urdf { file: self.file.to_owned(), line, message }
    }

    /// The line of the first element `tag` whose `attribute` is `value`; 1 when there is none.
    fn line_of(&self, tag: &str, attribute: &str, value: &str) -> usize {
        let Ok(document) = roxmltree::Document::parse(self.text) else { return 1 };
        let found = document.descendants().find(|n| n.has_tag_name(tag) && n.attribute(attribute) == Some(value));
        found.map_or(1, |node| document.text_pos_at(node.range().start).row as usize)
    }

    fn read(mut self) -> Result<Kinematics, ModelError> {
        let document = roxmltree::Document::parse(self.text)
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
        self.check_elements(&document)?;
        let robot = urdf_rs::read_from_string(self.text).map_err(|error| self.invalid(1, error.to_string()))?;
        let palette: BTreeMap<&str, [f64; 4]> = robot
            .materials
            .iter()
            .filter_map(|material| Some((material.name.as_str(), *material.color.as_ref()?.rgba)))
            .collect();
        let mut links = Vec::with_capacity(robot.links.len());
        for link in &robot.links {
            links.push(self.read_link(link, &palette)?);
        }
        let (joints, variables) = self.read_joints(&robot, &mut links)?;
        // `connect` made sure that there is exactly one root.
        let root = LinkId(links.iter().position(|link| link.parent_joint.is_none()).unwrap_or(0));
        Ok(Kinematics { name: robot.name, links, joints, root, variables })
    }

    /// What urdf-rs would report without a line, or not at all: missing attributes, bad numbers, names that stand twice.
    fn check_elements(&self, document: &roxmltree::Document<'_>) -> Result<(), ModelError> {
        let mut named: BTreeMap<(&str, &str), usize> = BTreeMap::new();
        for node in document.root_element().children().filter(|n| n.has_tag_name("link") || n.has_tag_name("joint")) {
            let (kind, name) = (node.tag_name().name(), node.attribute("name").unwrap_or_default());
            let line = document.text_pos_at(node.range().start).row as usize;
            if let Some(first) = named.insert((kind, name), line) {
                return Err(self
                    .invalid(line, format!("{kind} `{name}` stands already in line {first}; expected a unique name")));
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
                    return Err(self.invalid(line, format!("<{tag}> has no `{attribute}`")));
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
                    return Err(self.invalid(line, message));
                }
            }
        }
        Ok(())
    }

    fn read_link(&mut self, link: &urdf_rs::Link, palette: &BTreeMap<&str, [f64; 4]>) -> Result<Link, ModelError> {
        let mut collisions = Vec::with_capacity(link.collision.len());
        for collision in &link.collision {
            let geometry = self.read_geometry(&collision.geometry)?;
            collisions.push(CollisionShape { link_from_shape: to_pose(&collision.origin), geometry });
        }
        let mut visuals = Vec::with_capacity(link.visual.len());
        for visual in &link.visual {
            let rgba = visual.material.as_ref().and_then(|material| {
                material.color.as_ref().map(|color| *color.rgba).or_else(|| palette.get(&*material.name).copied())
            });
            visuals.push(VisualShape {
                link_from_shape: to_pose(&visual.origin),
                geometry: self.read_geometry(&visual.geometry)?,
                rgba: rgba.unwrap_or([0.5, 0.5, 0.5, 1.0]).map(|channel| channel as f32),
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

    fn read_geometry(&mut self, geometry: &urdf_rs::Geometry) -> Result<Geometry, ModelError> {
        Ok(match geometry {
            urdf_rs::Geometry::Box { size } => Geometry::Box { size_m: Vector3::from(**size) },
            urdf_rs::Geometry::Cylinder { radius, length } => {
                Geometry::Cylinder { radius_m: *radius, length_m: *length }
            }
            urdf_rs::Geometry::Capsule { radius, length } => Geometry::Capsule { radius_m: *radius, length_m: *length },
            urdf_rs::Geometry::Sphere { radius } => Geometry::Sphere { radius_m: *radius },
            urdf_rs::Geometry::Mesh { filename, scale } => {
                let scale = scale.map_or([1.0; 3], |s| *s);
                Geometry::Mesh(self.read_mesh(filename, scale)?)
            }
        })
    }

    fn read_mesh(&mut self, name: &str, scale: [f64; 3]) -> Result<Arc<Mesh>, ModelError> {
        let line = self.line_of("mesh", "filename", name);
        let path = self.find_file(name).ok_or_else(|| {
            self.invalid(line, format!("mesh `{name}` does not exist (looked in the folders above the URDF)"))
        })?;
        let key = (path.clone(), scale.map(f64::to_bits));
        if let Some(known) = self.meshes.get(&key) {
            return Ok(known.clone());
        }
        let scene = mesh_loader::Loader::default()
            .load(&path)
            .map_err(|error| self.invalid(line, format!("mesh `{name}` cannot be read: {error}")))?;
        let mut mesh = Mesh { file: path, vertices: Vec::new(), triangles: Vec::new() };
        for part in &scene.meshes {
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend(part.vertices.iter().map(|v| {
                Point3::new(f64::from(v[0]) * scale[0], f64::from(v[1]) * scale[1], f64::from(v[2]) * scale[2])
            }));
            mesh.triangles.extend(part.faces.iter().map(|face| face.map(|corner| corner + first)));
        }
        if mesh.triangles.is_empty() {
            return Err(self.invalid(line, format!("mesh `{name}` holds no triangles")));
        }
        let mesh = Arc::new(mesh);
        self.meshes.insert(key, mesh.clone());
        Ok(mesh)
    }

    fn find_file(&self, name: &str) -> Option<PathBuf> {
        let folder = self.file.parent().unwrap_or(Path::new("."));
        if let Some(inside) = name.strip_prefix("package://") {
            let folder = folder.canonicalize().ok()?;
            return folder.ancestors().map(|above| above.join(inside)).find(|path| path.is_file());
        }
        let path = folder.join(name.strip_prefix("file://").unwrap_or(name));
        path.is_file().then_some(path)
    }

    fn read_joints(&self, robot: &urdf_rs::Robot, links: &mut [Link]) -> Result<(Vec<Joint>, JointNames), ModelError> {
        let link_named = |joint: &urdf_rs::Joint, name: &str| {
            let found = links.iter().position(|link| link.name == name).map(LinkId);
            found.ok_or_else(|| {
                let near = dsm::config::find_nearest(name, links.iter().map(|link| link.name.as_str()))
                    .map_or_else(String::new, |near| format!("; did you mean `{near}`?"));
                let line = self.line_of("joint", "name", &joint.name);
                self.invalid(line, format!("joint `{}` names link `{name}`, which does not exist{near}", joint.name))
            })
        };
        let mut joints = Vec::with_capacity(robot.joints.len());
        for joint in &robot.joints {
            let line = self.line_of("joint", "name", &joint.name);
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
                    return Err(self.invalid(line, message));
                }
            };
            let axis = Vector3::from(*joint.axis.xyz);
            let axis = match Unit::try_new(axis, 1e-9) {
                Some(axis) => axis,
                None if kind == JointKind::Fixed => Vector3::x_axis(),
                None => return Err(self.invalid(line, format!("the axis of joint `{}` is zero", joint.name))),
            };
            joints.push(Joint {
                name: joint.name.clone(),
                kind,
                parent: link_named(joint, &joint.parent.link)?,
                child: link_named(joint, &joint.child.link)?,
                parent_from_joint: to_pose(&joint.origin),
                axis,
                limits: self.read_limits(joint, kind, line)?,
                drive: Drive::Fixed,
                damping: joint.dynamics.as_ref().map_or(0.0, |dynamics| dynamics.damping),
            });
        }
        self.connect(robot, links, joints)
    }

    fn read_limits(&self, joint: &urdf_rs::Joint, kind: JointKind, line: usize) -> Result<JointLimits, ModelError> {
        let limit = &joint.limit;
        let or_infinite = |value: f64| if value > 0.0 { value } else { f64::INFINITY };
        let (lower, upper) = match kind {
            JointKind::Fixed => (0.0, 0.0),
            JointKind::Continuous => (f64::NEG_INFINITY, f64::INFINITY),
            JointKind::Revolute | JointKind::Prismatic => (limit.lower, limit.upper),
        };
        if lower > upper {
            let message = format!("joint `{}` has lower limit {lower} above its upper limit {upper}", joint.name);
            return Err(self.invalid(line, message));
        }
        let (velocity, effort) = (or_infinite(limit.velocity), or_infinite(limit.effort));
        Ok(JointLimits { lower, upper, velocity, effort })
    }

    /// Orders joints parents first and gives every moving joint its variable.
    fn connect(
        &self,
        robot: &urdf_rs::Robot,
        links: &mut [Link],
        mut joints: Vec<Joint>,
    ) -> Result<(Vec<Joint>, JointNames), ModelError> {
        let mut carried = vec![false; links.len()];
        for joint in &joints {
            if std::mem::replace(&mut carried[joint.child.0], true) {
                let line = self.line_of("joint", "name", &joint.name);
                let child = &links[joint.child.0].name;
                return Err(self.invalid(line, format!("link `{child}` is the child of two joints")));
            }
        }
        let mut reached: Vec<bool> = carried.iter().map(|carried| !carried).collect();
        if reached.iter().filter(|root| **root).count() != 1 {
            let roots: Vec<&str> =
                links.iter().zip(&reached).filter(|(_, root)| **root).map(|(link, _)| link.name.as_str()).collect();
            return Err(self.invalid(1, format!("expected one root link, found {}: {}", roots.len(), roots.join(", "))));
        }
        let mut ordered = Vec::with_capacity(joints.len());
        while !joints.is_empty() {
            let Some(next) = joints.iter().position(|joint| reached[joint.parent.0]) else {
                let line = self.line_of("joint", "name", &joints[0].name);
                return Err(self.invalid(line, format!("joint `{}` is part of a loop", joints[0].name)));
            };
            let joint = joints.remove(next);
            reached[joint.child.0] = true;
            links[joint.child.0].parent_joint = Some(ordered.len());
            ordered.push(joint);
        }
        let mimic_of = |name: &str| robot.joints.iter().find(|j| j.name == name).and_then(|j| j.mimic.as_ref());
        let mut variables: Vec<String> = Vec::new();
        for joint in ordered.iter().filter(|j| j.kind != JointKind::Fixed && mimic_of(&j.name).is_none()) {
            variables.push(joint.name.clone());
        }
        for joint in ordered.iter_mut().filter(|joint| joint.kind != JointKind::Fixed) {
            let (mut master, mut multiplier, mut offset) = (joint.name.clone(), 1.0, 0.0);
            // A mimic may follow a mimic; more hops than joints means that they follow each other.
            for _ in 0..=robot.joints.len() {
                let Some(mimic) = mimic_of(&master) else { break };
                offset += multiplier * mimic.offset.unwrap_or(0.0);
                multiplier *= mimic.multiplier.unwrap_or(1.0);
                master.clone_from(&mimic.joint);
            }
            let variable = variables.iter().position(|name| *name == master).ok_or_else(|| {
                let line = self.line_of("joint", "name", &joint.name);
                self.invalid(line, format!("joint `{}` mimics `{master}`, which is no moving joint", joint.name))
            })?;
            joint.drive = Drive::Variable { variable, multiplier, offset };
        }
        Ok((ordered, variables.into_iter().map(Arc::from).collect()))
    }
}

fn to_pose(pose: &urdf_rs::Pose) -> Pose {
    let ([x, y, z], [roll, pitch, yaw]) = (*pose.xyz, *pose.rpy);
    Pose::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_euler_angles(roll, pitch, yaw))
}
