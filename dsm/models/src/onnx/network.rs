//! An ONNX network, held to its checksum and to its ports.

use crate::networks::NetworkFile;
use rten::{DataType, Dimension, Model, ModelOptions, NodeId, ValueOrView, ValueType};
use rten_tensor::Tensor;
use rten_tensor::prelude::*;
use sha2::{Digest, Sha256};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a network cannot be used, or did not answer.
#[derive(Debug, Error)]
pub enum NetworkError {
    /// The file cannot be read.
    #[error("{}: {source}; `dsm models fetch` gets it, or: {from}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// Where it is from.
        from: String,
        /// Why.
        source: std::io::Error,
    },
    /// The file is another one.
    #[error("{}: its SHA-256 is {found}, expected {expected}", file.display())]
    Checksum {
        /// The file.
        file: PathBuf,
        /// What the file of models says.
        expected: String,
        /// What it is.
        found: String,
    },
    /// The file is no network that can be run.
    #[error("{}: no ONNX network that can be run: {reason}", file.display())]
    Load {
        /// The file.
        file: PathBuf,
        /// Why.
        reason: String,
    },
    /// The file is no tokenizer.
    #[error("{}: no tokenizer: {reason}", file.display())]
    Tokenizer {
        /// The file.
        file: PathBuf,
        /// Why.
        reason: String,
    },
    /// An input or output is missing.
    #[error("{}: there is no {what} {}; it has {}", file.display(), expected.join(" or "), found.join(", "))]
    NoPort {
        /// The file.
        file: PathBuf,
        /// `input` or `output`.
        what: &'static str,
        /// Names of which one is needed.
        expected: Vec<String>,
        /// The names that there are.
        found: Vec<String>,
    },
    /// An input that nobody fills.
    #[error("{}: nobody knows what to put into input {name}; expected are {}", file.display(), expected.join(", "))]
    UnknownInput {
        /// The file.
        file: PathBuf,
        /// The input.
        name: String,
        /// The inputs that are known.
        expected: Vec<String>,
    },
    /// A port of another shape or type.
    #[error("{}: {port} is {found}, expected {expected}", file.display())]
    Shape {
        /// The file.
        file: PathBuf,
        /// The port.
        port: String,
        /// The shape and type that it should have.
        expected: String,
        /// What it has.
        found: String,
    },
    /// The network did not run.
    #[error("{}: {reason}", file.display())]
    Run {
        /// The file.
        file: PathBuf,
        /// Why.
        reason: String,
    },
}

/// One axis of a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// Exactly so long.
    Is(usize),
    /// As long as it likes, or as it is filled.
    Any,
}

/// An input or output that a network must have.
#[derive(Clone, Copy, Debug)]
pub struct Port {
    /// Its names; exporters do not agree.
    pub names: &'static [&'static str],
    /// Its type.
    pub kind: DataType,
    /// Its axes.
    pub shape: &'static [Axis],
    /// Whether a network may do without.
    pub optional: bool,
}

/// A network that is ready to run.
pub struct Network {
    file: PathBuf,
    model: Model,
    inputs: Vec<Option<NodeId>>,
    outputs: Vec<Option<NodeId>>,
    ports: (&'static [Port], &'static [Port]),
}

/// What a network gave at one output.
#[derive(Clone, Debug, PartialEq)]
pub struct Given {
    /// Lengths of its axes.
    pub shape: Vec<usize>,
    /// Row-major values.
    pub values: Vec<f32>,
}

impl Port {
    /// A port that every network has.
    pub const fn new(names: &'static [&'static str], kind: DataType, shape: &'static [Axis]) -> Self {
        Self { names, kind, shape, optional: false }
    }

    /// The same for networks that may do without it.
    pub const fn or_none(self) -> Self {
        Self { optional: true, ..self }
    }

    fn fits(&self, lengths: &[Option<usize>]) -> bool {
        let fits = |(axis, length): (&Axis, &Option<usize>)| match (axis, length) {
            (Axis::Is(wanted), Some(length)) => wanted == length,
            _ => true,
        };
        self.shape.len() == lengths.len() && self.shape.iter().zip(lengths).all(fits)
    }

    fn describe(&self) -> String {
        let axis = |axis: &Axis| match axis {
            Axis::Is(length) => length.to_string(),
            Axis::Any => "any".to_owned(),
        };
        format!("{} [{}]", self.kind, self.shape.iter().map(axis).collect::<Vec<_>>().join(", "))
    }
}

/// The bytes of a file, held to its checksum.
///
/// # Errors
/// A file that cannot be read, another checksum.
pub(super) fn read(file: &NetworkFile) -> Result<Vec<u8>, NetworkError> {
    let bytes = std::fs::read(&file.file).map_err(|source| NetworkError::Read {
        file: file.file.clone(),
        from: file.source.clone(),
        source,
    })?;
    if let Some(expected) = &file.sha256 {
        let found = digest(&bytes);
        if found != *expected {
            return Err(NetworkError::Checksum { file: file.file.clone(), expected: expected.clone(), found });
        }
    }
    Ok(bytes)
}

/// SHA-256 in hexadecimal digits.
pub(super) fn digest(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

impl Network {
    /// Loads a network and checks that it has these ports.
    ///
    /// # Errors
    /// Any [`NetworkError`] but [`NetworkError::Run`].
    pub fn open(file: &NetworkFile, inputs: &'static [Port], outputs: &'static [Port]) -> Result<Self, NetworkError> {
        let model = ModelOptions::with_all_ops()
            .load(read(file)?)
            .map_err(|error| NetworkError::Load { file: file.file.clone(), reason: error.to_string() })?;
        let file = file.file.as_path();
        let found_inputs = find_ports(file, &model, "input", model.input_ids(), inputs)?;
        let found_outputs = find_ports(file, &model, "output", model.output_ids(), outputs)?;
        if let Some(id) = model.input_ids().iter().find(|id| !found_inputs.contains(&Some(**id))) {
            let name = name_of(&model, *id);
            let expected = inputs.iter().map(|port| port.names[0].to_owned()).collect();
            return Err(NetworkError::UnknownInput { file: file.to_owned(), name, expected });
        }
        let file = file.to_owned();
        Ok(Self { file, model, inputs: found_inputs, outputs: found_outputs, ports: (inputs, outputs) })
    }

    /// The file.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Number of weights.
    pub fn weights(&self) -> usize {
        self.model.total_params()
    }

    /// Whether it has the optional input of this place.
    pub fn has_input(&self, place: usize) -> bool {
        self.inputs.get(place).is_some_and(Option::is_some)
    }

    /// Whether it has the optional output of this place.
    pub fn has_output(&self, place: usize) -> bool {
        self.outputs.get(place).is_some_and(Option::is_some)
    }

    /// Length of an axis of an input, where the network fixes it.
    pub fn find_length(&self, input: usize, axis: usize) -> Option<usize> {
        let id = (*self.inputs.get(input)?)?;
        match self.model.node_info(id)?.shape()?.get(axis)? {
            Dimension::Fixed(length) => Some(*length),
            Dimension::Symbolic(_) => None,
        }
    }

    /// Runs it. `inputs` are by place; those that the network does not have are left out. Gives the outputs by place.
    ///
    /// # Errors
    /// [`NetworkError::Run`], or [`NetworkError::Shape`] when an output has another shape than it must have.
    pub fn run(&self, inputs: Vec<(usize, ValueOrView<'_>)>) -> Result<Vec<Option<Given>>, NetworkError> {
        let failed = |reason: String| NetworkError::Run { file: self.file.clone(), reason };
        let inputs = inputs.into_iter().filter_map(|(place, value)| Some(((*self.inputs.get(place)?)?, value)));
        let wanted: Vec<NodeId> = self.outputs.iter().flatten().copied().collect();
        let values = self.model.run(inputs.collect(), &wanted, None).map_err(|error| failed(error.to_string()))?;
        let mut values = values.into_iter();
        let mut given = Vec::with_capacity(self.outputs.len());
        for (port, id) in self.ports.1.iter().zip(&self.outputs) {
            if id.is_none() {
                given.push(None);
                continue;
            }
            let value = values.next().ok_or_else(|| failed("an output is missing".to_owned()))?;
            let tensor: Tensor<f32> = value.try_into().map_err(|_| failed(format!("{} is not f32", port.names[0])))?;
            let shape = tensor.shape().to_vec();
            let lengths: Vec<Option<usize>> = shape.iter().copied().map(Some).collect();
            if !port.fits(&lengths) {
                return Err(NetworkError::Shape {
                    file: self.file.clone(),
                    port: format!("output {}", port.names[0]),
                    expected: port.describe(),
                    found: format!("{shape:?}"),
                });
            }
            given.push(Some(Given { shape, values: tensor.into_data() }));
        }
        Ok(given)
    }

    /// The only output of a network, or its first.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub(super) fn run_one(&self, inputs: Vec<(usize, ValueOrView<'_>)>) -> Result<Given, NetworkError> {
        let first = self.run(inputs)?.into_iter().flatten().next();
        first.ok_or_else(|| NetworkError::Run { file: self.file.clone(), reason: "there is no output".to_owned() })
    }
}

fn name_of(model: &Model, id: NodeId) -> String {
    model.node_info(id).and_then(|info| info.name().map(str::to_owned)).unwrap_or_else(|| "(without a name)".to_owned())
}

/// The nodes of the ports, each checked.
fn find_ports(
    file: &Path,
    model: &Model,
    what: &'static str,
    nodes: &[NodeId],
    ports: &[Port],
) -> Result<Vec<Option<NodeId>>, NetworkError> {
    let names: Vec<String> = nodes.iter().map(|id| name_of(model, *id)).collect();
    let mut found = Vec::with_capacity(ports.len());
    for port in ports {
        let place = port.names.iter().find_map(|name| names.iter().position(|known| known == name));
        let Some(place) = place else {
            if port.optional {
                found.push(None);
                continue;
            }
            let expected = port.names.iter().map(|&name| name.to_owned()).collect();
            return Err(NetworkError::NoPort { file: file.to_owned(), what, expected, found: names });
        };
        check_port(file, model, what, (nodes[place], &names[place]), port)?;
        found.push(Some(nodes[place]));
    }
    Ok(found)
}

fn check_port(
    file: &Path,
    model: &Model,
    what: &str,
    (id, name): (NodeId, &str),
    port: &Port,
) -> Result<(), NetworkError> {
    let Some(info) = model.node_info(id) else { return Ok(()) };
    let kind = match info.dtype() {
        Some(ValueType::Tensor(kind)) => Some(kind),
        _ => None,
    };
    let shape = info.shape();
    let lengths = shape.as_ref().map(|shape| {
        let length = |axis: &Dimension| match axis {
            Dimension::Fixed(length) => Some(*length),
            Dimension::Symbolic(_) => None,
        };
        shape.iter().map(length).collect::<Vec<_>>()
    });
    let kind_fits = kind.is_none_or(|kind| kind == port.kind);
    if kind_fits && lengths.as_ref().is_none_or(|lengths| port.fits(lengths)) {
        return Ok(());
    }
    let axes = |shape: Vec<Dimension>| {
        let axis = |axis: &Dimension| match axis {
            Dimension::Fixed(length) => length.to_string(),
            Dimension::Symbolic(name) => name.clone(),
        };
        shape.iter().map(axis).collect::<Vec<_>>().join(", ")
    };
    let kind = kind.map_or_else(|| "of unknown type".to_owned(), |kind| kind.to_string());
    Err(NetworkError::Shape {
        file: file.to_owned(),
        port: format!("{what} {name}"),
        expected: port.describe(),
        found: format!("{kind} [{}]", shape.map(axes).unwrap_or_default()),
    })
}
