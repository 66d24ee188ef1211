//! A draft as files: MJCF, semantics and textures.

use super::GeneratedScene;
use super::draft::{Body, Draft, Geom, Joint, Part, Rect, Shape};
use super::finish::{Finish, Material, Pattern};
use super::texture::{draw_texture, repeats};
use crate::scene::semantics::SEMANTICS_FILE;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

/// Below this a thing is light, kilograms ...
const LIGHT_KG: f64 = 0.5;
/// ... and above this it is heavy.
const HEAVY_KG: f64 = 5.0;

/// Mass of a free body whose mass is not known, kilograms.
const FREE_KG: f64 = 0.2;

/// Writes both texts and the textures.
pub(super) fn write_scene(draft: &Draft) -> GeneratedScene {
    let finishes: BTreeSet<Finish> = all_geoms(draft).map(|geom| geom.finish).collect();
    let mut textures = BTreeMap::new();
    for finish in &finishes {
        if let (Some(name), Some(png)) = (finish.texture(), draw_texture(finish)) {
            textures.insert(name, png);
        }
    }
    let names: Vec<&String> = textures.keys().collect();
    let mut files = vec![
        ("scene.xml".to_owned(), scene_xml(draft, &finishes, &names).into_bytes()),
        (SEMANTICS_FILE.to_owned(), semantics_toml(draft).into_bytes()),
    ];
    files.extend(textures.into_iter().map(|(name, png)| (format!("textures/{name}.png"), png)));
    let categories: BTreeSet<&str> = draft.bodies.iter().map(|body| body.meaning.category.as_str()).collect();
    GeneratedScene {
        name: draft.name.clone(),
        files,
        rooms: draft.rooms.len(),
        objects: draft.bodies.len(),
        categories: categories.len(),
    }
}

fn all_geoms(draft: &Draft) -> impl Iterator<Item = &Geom> {
    let of_bodies = draft
        .bodies
        .iter()
        .flat_map(|body| body.geoms.0.iter().chain(body.parts.iter().flat_map(|part| part.geoms.0.iter())));
    draft.shell.iter().map(|(_, geom)| geom).chain(of_bodies)
}

/// A number with at most four digits after the point, without needless zeros.
fn number(value: f64) -> String {
    let text = format!("{value:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

fn numbers(values: &[f64]) -> String {
    values.iter().map(|value| number(*value)).collect::<Vec<_>>().join(" ")
}

fn scene_xml(draft: &Draft, finishes: &BTreeSet<Finish>, textures: &[&String]) -> String {
    let mut xml = String::new();
    let _ = writeln!(xml, "<!-- {} -->", draft.origin.replace("--", "- -"));
    let _ = writeln!(xml, "<mujoco model=\"{}\">", draft.name);
    xml.push_str(HEAD);
    xml.push_str("  <asset>\n");
    for name in textures {
        let _ = writeln!(xml, "    <texture name=\"{name}\" type=\"2d\" file=\"{name}.png\"/>");
    }
    for finish in finishes {
        let texture = finish.texture().map_or_else(String::new, |texture| {
            let (repeat, per_metre) = repeats(finish.pattern);
            format!(" texture=\"{texture}\" texuniform=\"{per_metre}\" texrepeat=\"{0} {0}\"", number(repeat))
        });
        // Patterns of two colours carry them in their texture.
        let two_colors = matches!(finish.pattern, Pattern::Striped | Pattern::Checkered | Pattern::Dotted);
        let [r, g, b] = if two_colors { [1.0; 3] } else { finish.rgb() };
        let gloss = number(finish.gloss());
        let metallic = if finish.material == Material::Metal { " metallic=\"0.9\"" } else { "" };
        let _ = writeln!(
            xml,
            "    <material name=\"{}\"{texture} rgba=\"{} 1\" specular=\"{gloss}\" shininess=\"{gloss}\"{metallic}/>",
            finish.name(),
            numbers(&[r, g, b]),
        );
    }
    xml.push_str("  </asset>\n\n  <worldbody>\n");
    xml.push_str(LIGHTS);
    for (name, geom) in &draft.shell {
        let _ = writeln!(xml, "    <geom name=\"{name}\"{}/>", geom_text(geom));
    }
    for body in &draft.bodies {
        write_body(&mut xml, body);
    }
    xml.push_str("  </worldbody>\n</mujoco>\n");
    xml
}

const HEAD: &str = r#"  <compiler angle="radian" autolimits="true" texturedir="textures"/>
  <option timestep="0.002" gravity="0 0 -9.81"/>
  <visual>
    <headlight ambient="0.42 0.42 0.42" diffuse="0.15 0.15 0.15" specular="0 0 0"/>
  </visual>

  <default>
    <geom type="box" friction="0.6 0.005 0.0001"/>
    <default class="visual"><geom contype="0" conaffinity="0" mass="0" group="1"/></default>
  </default>

"#;

const LIGHTS: &str = r#"    <light name="sun" directional="true" pos="2 -3 6" dir="-0.35 0.45 -0.82" diffuse="0.5 0.48 0.44" specular="0.15 0.15 0.15" castshadow="true"/>
    <light name="fill" directional="true" pos="-3 4 6" dir="0.4 -0.35 -0.85" diffuse="0.22 0.23 0.26" specular="0 0 0" castshadow="false"/>

"#;

/// Attributes of a geom without its name, beginning with a space.
fn geom_text(geom: &Geom) -> String {
    let mut text = if geom.visual { " class=\"visual\"".to_owned() } else { String::new() };
    let (kind, size) = match geom.shape {
        Shape::Box(half) => ("", numbers(&half)),
        Shape::Cylinder(radius, half) => (" type=\"cylinder\"", numbers(&[radius, half])),
        Shape::Sphere(radius) => (" type=\"sphere\"", number(radius)),
        Shape::Ellipsoid(radii) => (" type=\"ellipsoid\"", numbers(&radii)),
    };
    let _ = write!(text, "{kind} pos=\"{}\"", numbers(&geom.at_m));
    if geom.turn_rad != [0.0; 3] {
        let _ = write!(text, " euler=\"{}\"", numbers(&geom.turn_rad));
    }
    let _ = write!(text, " size=\"{size}\" material=\"{}\"", geom.finish.name());
    text
}

fn write_body(xml: &mut String, body: &Body) {
    let _ = write!(xml, "    <body name=\"{}\" pos=\"{}\"", body.name, numbers(&body.at_m));
    let yaw = number(body.yaw_rad);
    if yaw != "0" {
        let _ = write!(xml, " euler=\"0 0 {yaw}\"");
    }
    xml.push_str(">\n");
    if body.free {
        xml.push_str("      <freejoint/>\n");
    }
    let solid_m3: f64 = body.geoms.0.iter().filter(|geom| !geom.visual).map(|geom| geom.shape.volume_m3()).sum();
    for geom in &body.geoms.0 {
        let _ = write!(xml, "      <geom{}", geom_text(geom));
        if body.free && !geom.visual {
            let share = geom.shape.volume_m3() / solid_m3 * body.meaning.mass_kg.unwrap_or(FREE_KG);
            let friction = number(geom.finish.material.friction());
            let _ = write!(xml, " mass=\"{share:.5}\" friction=\"{friction} 0.005 0.0001\" condim=\"4\"");
        }
        xml.push_str("/>\n");
    }
    for part in &body.parts {
        write_part(xml, body, part);
    }
    xml.push_str("    </body>\n");
}

fn write_part(xml: &mut String, body: &Body, part: &Part) {
    let name = format!("{}_{}", body.name, part.name);
    let _ = writeln!(xml, "      <body name=\"{name}\" pos=\"{}\">", numbers(&part.at_m));
    let (kind, axis, open) = match part.joint {
        Joint::Hinge { open_rad } => ("hinge", "0 0 1", open_rad),
        Joint::Slide { open_m } => ("slide", "0 -1 0", open_m),
    };
    let range = numbers(&[open.min(0.0), open.max(0.0)]);
    let feel = part.feel.map_or_else(
        || "damping=\"1\"".to_owned(),
        |feel| format!("damping=\"{}\" frictionloss=\"{}\"", number(feel.damping), number(feel.friction)),
    );
    let _ = writeln!(xml, "        <joint name=\"{name}\" type=\"{kind}\" axis=\"{axis}\" range=\"{range}\" {feel}/>");
    for geom in &part.geoms.0 {
        let _ = write!(xml, "        <geom{}", geom_text(geom));
        if let Some(feel) = part.feel {
            let (mass, friction) = (geom.shape.volume_m3() * feel.kg_per_m3, number(geom.finish.material.friction()));
            let _ = write!(xml, " mass=\"{mass:.5}\" friction=\"{friction} 0.005 0.0001\" condim=\"4\"");
        }
        xml.push_str("/>\n");
    }
    xml.push_str("      </body>\n");
}

fn semantics_toml(draft: &Draft) -> String {
    let mut text = String::new();
    let _ = writeln!(text, "# {}", draft.origin);
    text.push_str("# `category` names what the detector may see; all else about an object is for evaluation alone.\n");
    let _ = writeln!(text, "version = 1\nname = \"{}\"\n\n[start]\nareas = [", draft.name);
    for ([x, y], half) in &draft.starts {
        let [x, y, half] = [x, y, half].map(|v| number(*v));
        let _ = writeln!(text, "  {{ x_m = {x}, y_m = {y}, half_x_m = {half}, half_y_m = {half} }},");
    }
    text.push_str("]\n");
    for room in &draft.rooms {
        let Rect { min: [x1, y1], max: [x2, y2] } = room.outline;
        let [x1, y1, x2, y2] = [x1, y1, x2, y2].map(number);
        let _ = writeln!(text, "\n[[room]]\nname = \"{}\"", room.name);
        let _ = writeln!(text, "polygon = [[{x1}, {y1}], [{x2}, {y1}], [{x2}, {y2}], [{x1}, {y2}]]");
    }
    for body in &draft.bodies {
        write_object(&mut text, body);
    }
    text
}

fn write_object(text: &mut String, body: &Body) {
    let meaning = &body.meaning;
    let unusual = if meaning.unusual { " # unusual" } else { "" };
    let _ = writeln!(text, "\n[[object]]\nbody = \"{}\"\ncategory = \"{}\"", body.name, meaning.category);
    let _ = writeln!(text, "color = \"{}\"", meaning.finish.color.word());
    if meaning.material_known {
        let _ = writeln!(text, "material = \"{}\"{unusual}", meaning.finish.material.word());
    }
    let _ = writeln!(text, "pattern = \"{}\"", meaning.finish.pattern.word());
    if let Some(mass_kg) = meaning.mass_kg {
        let weight = match mass_kg {
            m if m < LIGHT_KG => "light",
            m if m <= HEAVY_KG => "medium",
            _ => "heavy",
        };
        let _ = writeln!(text, "weight_class = \"{weight}\"");
    }
    let affordances: Vec<String> = meaning.affordances.iter().map(|a| format!("\"{a}\"")).collect();
    let _ = writeln!(text, "affordances = [{}]", affordances.join(", "));
    if let Some(moves) = meaning.moves {
        let [x, y, yaw] = [moves.x_m, moves.y_m, moves.yaw_rad].map(number);
        let _ = writeln!(text, "placement = {{ x_m = {x}, y_m = {y}, yaw_rad = {yaw} }}");
    }
}
