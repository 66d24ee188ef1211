//! A folder with files, a command in it, and what the command must say.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

/// One test for each row: its name, the files, the command, and what its error must hold.
macro_rules! refuse {
    ($($(#[$doc:meta])* $name:ident: $bench:expr, $args:expr, $fragments:expr;)+) => {
        $($(#[$doc])* #[test] fn $name() { $bench.refuses(&$args, &$fragments); })+
    };
}
pub(crate) use refuse;

/// A scene with a table, an apple and two rooms' worth of floor.
pub(crate) const SCENE: &str = r#"<mujoco model="small">
  <asset>
    <material name="red" rgba="0.8 0.1 0.1 1"/>
  </asset>
  <worldbody>
    <geom name="floor" type="box" size="3 3 0.05" pos="0 0 -0.05"/>
    <body name="table_1" pos="1.5 0 0.2"><geom type="box" size="0.3 0.3 0.2"/></body>
    <body name="apple_1" pos="1.5 0 0.44">
      <freejoint/>
      <geom type="sphere" size="0.035" mass="0.18" material="red"/>
    </body>
  </worldbody>
</mujoco>
"#;

/// Semantics that fit [`SCENE`].
pub(crate) const SEMANTICS: &str = r#"version = 1
name = "small"

[start]
areas = [{ x_m = 0.0, y_m = 0.0 }]

[[room]]
name = "kitchen"
polygon = [[-3, -3], [3, -3], [3, 3], [-3, 3]]

[[object]]
body = "table_1"
category = "table"

[[object]]
body = "apple_1"
category = "apple"
placement = { x_m = 0.05, y_m = 0.05, yaw_rad = 1.0 }
"#;

/// An episode in [`SCENE`].
pub(crate) const EPISODE: &str = r#"version = 1
scene = "scene.xml"
robot = "porter"
seed = 1
time_limit_s = 60

[[step]]
command = "Grasp the apple"

[[expect]]
kind = "object_lifted"
object = "apple_1"
"#;

/// A working folder.
pub(crate) struct Bench {
    folder: TempDir,
    variables: Vec<(&'static str, &'static str)>,
}

impl Bench {
    /// A folder with a scene, its semantics and an episode that are right.
    pub(crate) fn new() -> Self {
        let bench = Self { folder: tempfile::tempdir().unwrap(), variables: Vec::new() };
        bench.file("scene.xml", SCENE).file("semantics.toml", SEMANTICS).file("episode.toml", EPISODE)
    }

    /// Adds or replaces a file.
    pub(crate) fn file(self, name: &str, bytes: impl AsRef<[u8]>) -> Self {
        let path = self.folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
        self
    }

    /// Replaces a part of a text file; the part must be there once.
    pub(crate) fn edit(self, name: &str, from: &str, to: &str) -> Self {
        let text = fs::read_to_string(self.folder.path().join(name)).unwrap();
        assert_eq!(text.matches(from).count(), 1, "`{from}` in {name}");
        self.file(name, text.replace(from, to))
    }

    /// Removes a file.
    pub(crate) fn without(self, name: &str) -> Self {
        fs::remove_file(self.folder.path().join(name)).unwrap();
        self
    }

    /// Adds an empty folder.
    pub(crate) fn folder(self, name: &str) -> Self {
        fs::create_dir_all(self.folder.path().join(name)).unwrap();
        self
    }

    /// Sets an environment variable for the command.
    pub(crate) fn variable(mut self, name: &'static str, value: &'static str) -> Self {
        self.variables.push((name, value));
        self
    }

    /// The folder.
    pub(crate) fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Runs `dsm` in the folder.
    pub(crate) fn run(&self, args: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_dsm"));
        for variable in
            ["DSM_SEED", "DSM_ROBOT", "DSM_PHYSICS", "DSM_PERCEPTION", "DSM_THREADS", "DSM_TIME_LIMIT_S", "DSM_LOG"]
        {
            command.env_remove(variable);
        }
        command.args(args).current_dir(self.path()).envs(self.variables.iter().copied()).output().unwrap()
    }

    /// Holds the contract: see the top of this test.
    pub(crate) fn refuses(&self, args: &[&str], fragments: &[&str]) {
        let before = self.contents();
        let output = self.run(args);
        let (stdout, stderr) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert_eq!(output.status.code(), Some(2), "{args:?}\nstdout: {stdout}\nstderr: {stderr}");
        assert_eq!(stdout, "", "stdout is for results");
        assert!(!stderr.contains("panicked"), "{stderr}");
        for fragment in fragments {
            assert!(stderr.contains(fragment), "`{fragment}` is missing in: {stderr}");
        }
        let after = self.contents();
        let changed: Vec<&PathBuf> =
            after.iter().filter(|(path, bytes)| before.get(*path) != Some(bytes)).map(|(path, _)| path).collect();
        assert!(changed.is_empty() && after.len() == before.len(), "written or changed: {changed:?}");
    }

    /// Everything in the folder; folders count as empty files.
    fn contents(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        let mut found = BTreeMap::new();
        let mut open = vec![self.path().to_owned()];
        while let Some(folder) = open.pop() {
            for entry in fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap()) {
                let is_folder = entry.file_type().unwrap().is_dir();
                let bytes = if is_folder { Vec::new() } else { fs::read(entry.path()).unwrap() };
                if is_folder {
                    open.push(entry.path());
                }
                found.insert(entry.path(), bytes);
            }
        }
        found
    }
}

#[test]
fn the_files_that_the_cases_break_are_right() {
    let bench = Bench::new();
    for args in [vec!["scene", "check", "scene.xml"], vec!["config", "show", "episode.toml"]] {
        let output = bench.run(&args);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{args:?}: {} {stderr}", String::from_utf8_lossy(&output.stdout));
    }
}
