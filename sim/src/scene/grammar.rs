//! The part of MJCF that scenes use: which element may hold which elements and attributes.
//!
//! `mjcf-rs` skips names that it does not know, MuJoCo refuses them; so does this check, with line and nearest name.
//! Elements that do not touch a scene (actuators, sensors, visual settings) are not looked into.

/// What an attribute may hold.
#[derive(Clone, Copy)]
pub(super) enum Value {
    /// Any text.
    Text,
    /// So many finite numbers.
    Numbers(usize, usize),
    /// So many finite numbers of at least 0.
    Positive(usize, usize),
    /// A whole number.
    Whole,
    /// One of these words.
    Word(&'static [&'static str]),
}

use Value::{Numbers, Positive, Text, Whole, Word};

const BOOL: Value = Word(&["true", "false"]);
const AUTO: Value = Word(&["true", "false", "auto"]);

/// Attributes of one element.
pub(super) type Attributes = &'static [(&'static str, Value)];

const POSE: Attributes = &[
    ("pos", Numbers(3, 3)),
    ("quat", Numbers(4, 4)),
    ("axisangle", Numbers(4, 4)),
    ("euler", Numbers(3, 3)),
    ("xyaxes", Numbers(6, 6)),
    ("zaxis", Numbers(3, 3)),
];

const GEOM: Attributes = &[
    ("name", Text),
    ("class", Text),
    ("type", Word(&["plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "sdf"])),
    ("contype", Whole),
    ("conaffinity", Whole),
    ("condim", Whole),
    ("group", Whole),
    ("priority", Whole),
    ("size", Positive(1, 3)),
    ("material", Text),
    ("rgba", Positive(4, 4)),
    ("friction", Positive(1, 3)),
    ("mass", Positive(1, 1)),
    ("density", Positive(1, 1)),
    ("shellinertia", BOOL),
    ("solmix", Numbers(1, 1)),
    ("solref", Numbers(1, 2)),
    ("solimp", Numbers(1, 5)),
    ("margin", Numbers(1, 1)),
    ("gap", Numbers(1, 1)),
    ("fromto", Numbers(6, 6)),
    ("hfield", Text),
    ("mesh", Text),
    ("fitscale", Numbers(1, 1)),
    ("fluidshape", Text),
    ("fluidcoef", Text),
    ("user", Text),
];

const JOINT: Attributes = &[
    ("name", Text),
    ("class", Text),
    ("type", Word(&["free", "ball", "slide", "hinge"])),
    ("group", Whole),
    ("pos", Numbers(3, 3)),
    ("axis", Numbers(3, 3)),
    ("springdamper", Numbers(2, 2)),
    ("limited", AUTO),
    ("actuatorfrclimited", AUTO),
    ("solreflimit", Text),
    ("solimplimit", Text),
    ("solreffriction", Text),
    ("solimpfriction", Text),
    ("stiffness", Text),
    ("range", Numbers(2, 2)),
    ("actuatorfrcrange", Numbers(2, 2)),
    ("actuatorgravcomp", BOOL),
    ("margin", Numbers(1, 1)),
    ("ref", Numbers(1, 1)),
    ("springref", Numbers(1, 1)),
    ("armature", Positive(1, 1)),
    ("damping", Text),
    ("frictionloss", Positive(1, 1)),
    ("user", Text),
];

const LIGHT: Attributes = &[
    ("name", Text),
    ("class", Text),
    ("mode", Text),
    ("target", Text),
    ("type", Word(&["spot", "directional", "point", "image"])),
    ("directional", BOOL),
    ("castshadow", BOOL),
    ("active", BOOL),
    ("pos", Numbers(3, 3)),
    ("dir", Numbers(3, 3)),
    ("diffuse", Positive(3, 3)),
    ("ambient", Positive(3, 3)),
    ("specular", Positive(3, 3)),
    ("attenuation", Positive(3, 3)),
    ("cutoff", Positive(1, 1)),
    ("exponent", Positive(1, 1)),
    ("bulbradius", Positive(1, 1)),
    ("intensity", Positive(1, 1)),
    ("range", Positive(1, 1)),
    ("texture", Text),
];

const TEXTURE: Attributes = &[
    ("name", Text),
    ("class", Text),
    ("type", Word(&["2d", "cube", "skybox"])),
    ("colorspace", Text),
    ("content_type", Text),
    ("file", Text),
    ("gridsize", Numbers(2, 2)),
    ("gridlayout", Text),
    ("fileright", Text),
    ("fileleft", Text),
    ("fileup", Text),
    ("filedown", Text),
    ("filefront", Text),
    ("fileback", Text),
    ("builtin", Word(&["none", "gradient", "checker", "flat"])),
    ("rgb1", Positive(3, 3)),
    ("rgb2", Positive(3, 3)),
    ("mark", Word(&["none", "edge", "cross", "random"])),
    ("markrgb", Positive(3, 3)),
    ("random", Positive(1, 1)),
    ("width", Whole),
    ("height", Whole),
    ("hflip", BOOL),
    ("vflip", BOOL),
    ("nchannel", Whole),
];

const MATERIAL: Attributes = &[
    ("name", Text),
    ("class", Text),
    ("texture", Text),
    ("texrepeat", Positive(2, 2)),
    ("texuniform", BOOL),
    ("emission", Positive(1, 1)),
    ("specular", Positive(1, 1)),
    ("shininess", Positive(1, 1)),
    ("reflectance", Positive(1, 1)),
    ("metallic", Numbers(1, 1)),
    ("roughness", Numbers(1, 1)),
    ("rgba", Positive(4, 4)),
];

const MESH: Attributes = &[
    ("name", Text),
    ("class", Text),
    ("content_type", Text),
    ("file", Text),
    ("scale", Numbers(3, 3)),
    ("inertia", Word(&["convex", "exact", "legacy", "shell"])),
    ("smoothnormal", Text),
    ("maxhullvert", Numbers(1, 1)),
    ("vertex", Text),
    ("normal", Text),
    ("texcoord", Text),
    ("face", Text),
    ("refpos", Numbers(3, 3)),
    ("refquat", Numbers(4, 4)),
    ("material", Text),
    ("user", Text),
];

const COMPILER: Attributes = &[
    ("autolimits", BOOL),
    ("boundmass", Positive(1, 1)),
    ("boundinertia", Positive(1, 1)),
    ("settotalmass", Numbers(1, 1)),
    ("balanceinertia", BOOL),
    ("strippath", BOOL),
    ("coordinate", Word(&["local"])),
    ("angle", Word(&["radian", "degree"])),
    ("fitaabb", BOOL),
    ("eulerseq", Text),
    ("meshdir", Text),
    ("texturedir", Text),
    ("assetdir", Text),
    ("discardvisual", BOOL),
    ("convexhull", BOOL),
    ("usethread", BOOL),
    ("fusestatic", BOOL),
    ("inertiafromgeom", AUTO),
    ("exactmeshinertia", BOOL),
    ("inertiagrouprange", Numbers(2, 2)),
    ("alignfree", BOOL),
    ("saveinertial", BOOL),
];

/// The attributes of an element, or `None` when the element is not looked into.
pub(super) fn find_attributes(element: &str) -> Option<Vec<(&'static str, Value)>> {
    let (own, pose): (Attributes, bool) = match element {
        "mujoco" => (&[("model", Text)], false),
        "worldbody" => (&[("name", Text)], false),
        "asset" => (&[], false),
        "compiler" => (COMPILER, false),
        "default" => (&[("class", Text)], false),
        "body" => (
            &[
                ("name", Text),
                ("class", Text),
                ("childclass", Text),
                ("mocap", BOOL),
                ("gravcomp", Numbers(1, 1)),
                ("sleep", Text),
                ("user", Text),
            ],
            true,
        ),
        "frame" => (&[("name", Text), ("class", Text), ("childclass", Text)], true),
        "inertial" => (
            &[
                ("mass", Positive(1, 1)),
                ("diaginertia", Positive(3, 3)),
                ("fullinertia", Numbers(6, 6)),
                ("class", Text),
            ],
            true,
        ),
        "freejoint" => (&[("name", Text), ("group", Whole), ("align", AUTO)], false),
        "joint" => (JOINT, false),
        "geom" => (GEOM, true),
        "light" => (LIGHT, false),
        "texture" => (TEXTURE, false),
        "material" => (MATERIAL, false),
        "mesh" => (MESH, false),
        _ => return None,
    };
    Some(own.iter().chain(if pose { POSE } else { &[] }).copied().collect())
}

/// The elements that may stand in an element, or `None` when it is not looked into.
pub(super) fn find_children(element: &str) -> Option<&'static [&'static str]> {
    Some(match element {
        "mujoco" => &[
            "compiler",
            "option",
            "size",
            "statistic",
            "visual",
            "custom",
            "extension",
            "default",
            "asset",
            "worldbody",
            "contact",
            "deformable",
            "equality",
            "tendon",
            "actuator",
            "sensor",
            "keyframe",
        ],
        "worldbody" => &["body", "frame", "geom", "site", "light", "camera"],
        "body" => &["body", "frame", "inertial", "joint", "freejoint", "geom", "site", "light", "camera"],
        "frame" => &["body", "frame", "joint", "freejoint", "geom", "site", "light", "camera"],
        "asset" => &["mesh", "hfield", "skin", "texture", "material", "model"],
        _ => return None,
    })
}

/// Elements of MJCF that make bodies or shapes in ways that this loader does not follow, with what to do instead.
pub(super) const UNSUPPORTED: &[(&str, &str)] = &[
    ("attach", "write the attached bodies out or include them"),
    ("replicate", "write the copies out"),
    ("composite", "write its bodies out"),
    ("flexcomp", "soft bodies are not simulated"),
    ("deformable", "soft bodies are not simulated"),
    ("hfield", "use a mesh"),
    ("plugin", "plugins are not loaded"),
];
