//! One POST with limits. The only file that knows the HTTP library.

use crate::error::{ModelError, shortened};
use crate::settings::LanguageSettings;
use std::io::Read;
use std::time::Duration;
use ureq::config::Config;
use ureq::{Agent, Body, Error, http};

/// Longest head of a reply, bytes.
const MAX_HEAD_BYTES: usize = 64 * 1024;

/// A reply as it came.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reply {
    /// HTTP status.
    pub status: u16,
    /// Seconds that the server asks to wait, if it says so in seconds.
    pub retry_after_s: Option<u64>,
    /// The body, no longer than the limit.
    pub body: Vec<u8>,
}

/// Sends a request and brings the reply.
pub trait Transport: Send + Sync {
    /// Posts a JSON body; the whole exchange takes no longer than `limit_s`.
    ///
    /// # Errors
    /// [`ModelError`] when there is no whole reply within the limits. A reply of any status is none.
    fn post(&self, body: &str, limit_s: f64) -> Result<Reply, ModelError>;
}

/// A server on the network. The key goes into the header of requests and nowhere else.
pub(crate) struct Server {
    agent: Agent,
    address: String,
    authorization: Option<String>,
    max_bytes: u64,
    connect_timeout_s: f64,
}

impl Server {
    /// A server by its settings; nothing is sent yet.
    pub(crate) fn new(settings: &LanguageSettings, key: Option<&str>) -> Self {
        let address = format!("{}/chat/completions", settings.url.trim_end_matches('/'));
        let mut config = Config::builder()
            .http_status_as_error(false)
            // A redirect would carry the key, or pictures of a home, to somebody else.
            .max_redirects(0)
            .max_redirects_will_error(false)
            .max_response_header_size(MAX_HEAD_BYTES)
            .user_agent("dsm");
        if is_this_machine(&settings.url) {
            config = config.proxy(None);
        }
        Self {
            agent: config.build().into(),
            address,
            authorization: key.map(|key| format!("Bearer {key}")),
            max_bytes: settings.max_response_bytes,
            connect_timeout_s: settings.connect_timeout_s,
        }
    }

    fn read(&self, mut response: http::Response<Body>, limit_s: f64) -> Result<Reply, ModelError> {
        let status = response.status().as_u16();
        let retry_after = response.headers().get("retry-after").and_then(|value| value.to_str().ok());
        let retry_after_s = retry_after.and_then(|value| value.trim().parse().ok());
        let too_long = ModelError::TooLong { limit_bytes: self.max_bytes };
        if response.body().content_length().is_some_and(|length| length > self.max_bytes) {
            return Err(too_long);
        }
        let mut body = Vec::new();
        let reader = response.body_mut().with_config().limit(u64::MAX).reader();
        reader.take(self.max_bytes + 1).read_to_end(&mut body).map_err(|error| {
            match meaning(error.into(), limit_s) {
                // There was a head, so the server was reached.
                ModelError::Unreachable { reason } => ModelError::Broken { reason },
                other => other,
            }
        })?;
        if body.len() as u64 > self.max_bytes {
            return Err(too_long);
        }
        Ok(Reply { status, retry_after_s, body })
    }
}

impl Transport for Server {
    fn post(&self, body: &str, limit_s: f64) -> Result<Reply, ModelError> {
        let limit = Duration::from_secs_f64(limit_s.max(0.001));
        let connect = Duration::from_secs_f64(self.connect_timeout_s.min(limit_s).max(0.001));
        let mut request = self.agent.post(&self.address).content_type("application/json");
        if let Some(authorization) = &self.authorization {
            request = request.header("Authorization", authorization);
        }
        let sent =
            request.config().timeout_global(Some(limit)).timeout_connect(Some(connect)).build().send(body.as_bytes());
        match sent {
            Ok(response) => self.read(response, limit_s),
            Err(error) => Err(meaning(error, limit_s)),
        }
    }
}

/// Longest file that is fetched, bytes.
const MAX_FILE_BYTES: u64 = 8 << 30;
/// Making a connection for a file, and the silence within one that is waited for, seconds.
const FILE_PATIENCE: Duration = Duration::from_secs(60);

/// Writes what an address gives to `out`, following its redirects.
///
/// # Errors
/// The network's, the server's or the file's words.
pub(crate) fn download(address: &str, out: &mut impl std::io::Write) -> Result<(), String> {
    let mut config = Config::builder()
        .user_agent("dsm")
        .timeout_connect(Some(FILE_PATIENCE))
        .timeout_recv_response(Some(FILE_PATIENCE));
    if is_this_machine(address) {
        config = config.proxy(None);
    }
    let agent: Agent = config.build().into();
    let mut response = agent.get(address).call().map_err(|error| shortened(&error.to_string(), 200))?;
    let mut reader = response.body_mut().with_config().limit(MAX_FILE_BYTES).reader();
    let written = std::io::copy(&mut reader, out).map_err(|error| shortened(&error.to_string(), 200))?;
    if written == 0 { Err("the file is empty".to_owned()) } else { Ok(()) }
}

fn meaning(error: Error, limit_s: f64) -> ModelError {
    match error {
        Error::Timeout(_) => ModelError::TimedOut { limit_s },
        Error::Io(error) if error.kind() == std::io::ErrorKind::TimedOut => ModelError::TimedOut { limit_s },
        Error::Protocol(error) => ModelError::Broken { reason: shortened(&error.to_string(), 200) },
        Error::Io(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => {
            ModelError::Broken { reason: shortened(&error.to_string(), 200) }
        }
        other => ModelError::Unreachable { reason: shortened(&other.to_string(), 200) },
    }
}

/// Whether the address is of this machine, which no proxy leads to.
fn is_this_machine(url: &str) -> bool {
    let host = url.split("://").nth(1).unwrap_or("");
    let host = host.split('/').next().unwrap_or("");
    let name = host.rsplit_once(':').map_or(host, |(name, _)| name);
    matches!(name, "localhost" | "[::1]") || name.starts_with("127.")
}
