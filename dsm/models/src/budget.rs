//! What may be spent: tokens and money of one run of the program.

use crate::error::ModelError;
use crate::settings::LanguageSettings;
use serde::Serialize;
use std::sync::{Mutex, PoisonError};

/// Characters that make a token, at least: the estimate before the server has counted is on the high side.
const CHARACTERS_PER_TOKEN: u64 = 2;
/// Tokens of one picture, an upper estimate.
const TOKENS_PER_PICTURE: u64 = 1600;
/// Most tokens that one request is believed to have cost, whatever the server says.
const MOST_TOKENS: u64 = 10_000_000;

/// What was spent so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Spent {
    /// Questions that were asked, in whatever way they were answered.
    pub questions: u64,
    /// Questions that the cache answered.
    pub cached: u64,
    /// Questions without an answer that can be used.
    pub failed: u64,
    /// Requests that were sent, repeated ones too.
    pub requests: u64,
    /// Tokens read by the model.
    pub input_tokens: u64,
    /// Tokens written by the model.
    pub output_tokens: u64,
    /// US dollars, by the prices of the settings.
    pub cost_usd: f64,
    /// Wall time of all questions, seconds.
    pub wall_s: f64,
}

/// Tokens of one request.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Tokens {
    pub(crate) input: u64,
    pub(crate) output: u64,
}

/// Keeps to a budget. What is under way counts as if it cost all that it may.
pub(crate) struct Budget {
    price_input_usd: f64,
    price_output_usd: f64,
    most_usd: Option<f64>,
    most_tokens: Option<u64>,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    spent: Spent,
    reserved: Tokens,
}

impl Tokens {
    /// The most that a request may cost.
    pub(crate) fn estimate(text_characters: usize, pictures: usize, max_tokens: u32) -> Self {
        let text = text_characters as u64 / CHARACTERS_PER_TOKEN + 1;
        Self { input: text + pictures as u64 * TOKENS_PER_PICTURE, output: u64::from(max_tokens) }
    }

    /// As counted by a server, within reason.
    pub(crate) fn counted(input: u64, output: u64) -> Self {
        Self { input: input.min(MOST_TOKENS), output: output.min(MOST_TOKENS) }
    }

    fn all(self) -> u64 {
        self.input + self.output
    }
}

impl Budget {
    pub(crate) fn new(settings: &LanguageSettings) -> Self {
        Self {
            price_input_usd: settings.price_input_usd * 1e-6,
            price_output_usd: settings.price_output_usd * 1e-6,
            most_usd: settings.budget_usd,
            most_tokens: settings.budget_tokens,
            state: Mutex::default(),
        }
    }

    /// US dollars for so many tokens.
    pub(crate) fn cost_usd(&self, tokens: Tokens) -> f64 {
        tokens.input as f64 * self.price_input_usd + tokens.output as f64 * self.price_output_usd
    }

    /// Sets aside what a request may cost.
    pub(crate) fn reserve(&self, tokens: Tokens) -> Result<(), ModelError> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let all = Tokens { input: state.reserved.input + tokens.input, output: state.reserved.output + tokens.output };
        let used = state.spent.input_tokens + state.spent.output_tokens + all.all();
        if let Some(most) = self.most_tokens.filter(|most| used > *most) {
            return Err(ModelError::Spent { limit: format!("{most} tokens") });
        }
        let cost = state.spent.cost_usd + self.cost_usd(all);
        if let Some(most) = self.most_usd.filter(|most| cost > *most) {
            return Err(ModelError::Spent { limit: format!("{most} US dollars") });
        }
        state.reserved = all;
        Ok(())
    }

    /// Takes a reservation back and books what the request cost instead.
    pub(crate) fn book(&self, reserved: Tokens, used: Tokens) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.reserved.input = state.reserved.input.saturating_sub(reserved.input);
        state.reserved.output = state.reserved.output.saturating_sub(reserved.output);
        state.spent.requests += 1;
        state.spent.input_tokens += used.input;
        state.spent.output_tokens += used.output;
        state.spent.cost_usd += self.cost_usd(used);
    }

    /// Counts a question that ended.
    pub(crate) fn count(&self, cached: u64, failed: u64, wall_s: f64) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.spent.questions += 1;
        state.spent.cached += cached;
        state.spent.failed += failed;
        state.spent.wall_s += wall_s;
    }

    /// What was spent so far.
    pub(crate) fn spent(&self) -> Spent {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).spent
    }
}

#[cfg(test)]
mod tests {
    //! Contract: no request begins that could break the budget, also when several are under way.
    use super::*;

    #[test]
    fn what_is_under_way_counts() {
        let mut settings = LanguageSettings::new("http://localhost", "m");
        (settings.budget_tokens, settings.budget_usd) = (Some(1000), Some(0.01));
        (settings.price_input_usd, settings.price_output_usd) = (1.0, 20.0);
        let budget = Budget::new(&settings);
        let request = Tokens { input: 100, output: 300 };
        assert!(budget.reserve(request).is_ok(), "0.0061 dollars");
        assert_eq!(budget.reserve(request), Err(ModelError::Spent { limit: "0.01 US dollars".into() }));
        budget.book(request, Tokens { input: 90, output: 10 });
        assert!((budget.spent().cost_usd - 0.00029).abs() < 1e-12);
        assert!(budget.reserve(request).is_ok());
        budget.book(request, Tokens::counted(u64::MAX, 5));
        assert_eq!(budget.reserve(request), Err(ModelError::Spent { limit: "1000 tokens".into() }));
    }
}
