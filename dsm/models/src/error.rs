//! Why a question has no answer that can be used.

use thiserror::Error;

/// Why a question has no answer that can be used. None of the texts holds a key.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ModelError {
    /// No connection, or it broke before the reply began.
    #[error("the server cannot be reached: {reason}")]
    Unreachable {
        /// The network's words.
        reason: String,
    },
    /// The server did not reply, or not to the end, in time.
    #[error("no whole reply within {limit_s:.2} s")]
    TimedOut {
        /// The limit, seconds.
        limit_s: f64,
    },
    /// The reply broke off, or was no HTTP.
    #[error("the reply broke off or is no HTTP: {reason}")]
    Broken {
        /// What was wrong.
        reason: String,
    },
    /// The reply is longer than the limit.
    #[error("the reply is longer than {limit_bytes} bytes")]
    TooLong {
        /// The limit.
        limit_bytes: u64,
    },
    /// The server refuses the request.
    #[error("the server refuses with status {status}: {message}")]
    Refused {
        /// HTTP status.
        status: u16,
        /// The server's words, cut short.
        message: String,
    },
    /// The server is busy or broken, and stayed so.
    #[error("the server answers with status {status}: {message}")]
    Failing {
        /// HTTP status.
        status: u16,
        /// The server's words, cut short.
        message: String,
    },
    /// The server asks for a longer pause than is allowed.
    #[error("the server asks for a pause of {pause_s:.0} s; at most {limit_s:.0} s are waited")]
    PauseTooLong {
        /// The pause, seconds.
        pause_s: f64,
        /// The limit, seconds.
        limit_s: f64,
    },
    /// The reply is no chat completion.
    #[error("the reply is no chat completion: {reason}")]
    NoCompletion {
        /// What is wrong.
        reason: String,
    },
    /// The model declines to answer.
    #[error("the model declines: {words}")]
    Declined {
        /// Its words, cut short.
        words: String,
    },
    /// The answer has not the form that was asked for, also after it was asked to repair it.
    #[error("the answer cannot be used: {reason}")]
    Unusable {
        /// What is wrong.
        reason: String,
    },
    /// The budget does not allow the question.
    #[error("the budget of {limit} is spent")]
    Spent {
        /// The limit.
        limit: String,
    },
    /// Only cached answers are allowed, and there is none.
    #[error("there is no cached answer")]
    NotCached,
    /// The server was away a moment ago, and is not asked for a while.
    #[error("the server was away and is asked again in {in_s:.0} s: {reason}")]
    Away {
        /// Until it is asked again, seconds.
        in_s: f64,
        /// The last failure.
        reason: String,
    },
    /// All requests that may be under way at a time were under way for too long.
    #[error("no request could begin within {limit_s:.2} s")]
    Busy {
        /// The limit, seconds.
        limit_s: f64,
    },
    /// The model is not asked for this.
    #[error("the model is not asked for this")]
    NotAsked,
}

impl ModelError {
    /// Whether the same request may succeed a moment later.
    pub(crate) fn may_pass(&self) -> bool {
        matches!(self, Self::Unreachable { .. } | Self::TimedOut { .. } | Self::Broken { .. } | Self::Failing { .. })
    }

    /// Whether nothing was heard of the server.
    pub(crate) fn is_silence(&self) -> bool {
        matches!(self, Self::Unreachable { .. } | Self::TimedOut { .. })
    }

    /// The same with what the server said changed.
    pub(crate) fn with_words(self, change: impl Fn(&str) -> String) -> Self {
        match self {
            Self::NoCompletion { reason } => Self::NoCompletion { reason: change(&reason) },
            Self::Declined { words } => Self::Declined { words: change(&words) },
            Self::Broken { reason } => Self::Broken { reason: change(&reason) },
            other => other,
        }
    }

    /// One word for traces and tables.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Unreachable { .. } => "unreachable",
            Self::TimedOut { .. } => "timed_out",
            Self::Broken { .. } => "broken",
            Self::TooLong { .. } => "too_long",
            Self::Refused { .. } => "refused",
            Self::Failing { .. } => "failing",
            Self::PauseTooLong { .. } => "pause_too_long",
            Self::NoCompletion { .. } => "no_completion",
            Self::Declined { .. } => "declined",
            Self::Unusable { .. } => "unusable",
            Self::Spent { .. } => "spent",
            Self::NotCached => "not_cached",
            Self::Away { .. } => "away",
            Self::Busy { .. } => "busy",
            Self::NotAsked => "not_asked",
        }
    }
}

/// At most `most` characters of a text from outside, control characters as spaces.
pub(crate) fn shortened(text: &str, most: usize) -> String {
    let clean = |c: char| if c.is_control() { ' ' } else { c };
    let mut short: String = text.chars().take(most).map(clean).collect();
    if text.chars().nth(most).is_some() {
        short.push('…');
    }
    short
}
