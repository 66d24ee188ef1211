//! Thoughts of models that think aloud before they answer.

/// Marks around thoughts, as several families of models write them.
const MARKS: [(&str, &str); 4] = [
    ("<think>", "</think>"),
    ("<thinking>", "</thinking>"),
    ("<thought>", "</thought>"),
    ("<reasoning>", "</reasoning>"),
];

/// A text without its thoughts, and the thoughts. A thought that never ends leaves no answer.
pub(crate) fn split_thought(text: &str) -> (String, String) {
    let (mut answer, mut thought) = (text.to_owned(), String::new());
    for (open, close) in MARKS {
        // Some servers cut the opening mark off.
        if let (None, Some(end)) = (answer.find(open), answer.find(close)) {
            thought.push_str(&answer[..end]);
            answer = answer[end + close.len()..].to_owned();
        }
        while let Some(start) = answer.find(open) {
            let inner = start + open.len();
            let (end, after) = match answer[inner..].find(close) {
                Some(length) => (inner + length, inner + length + close.len()),
                None => (answer.len(), answer.len()),
            };
            thought.push_str(&answer[inner..end]);
            answer = format!("{}{}", &answer[..start], &answer[after..]);
        }
    }
    (answer.trim().to_owned(), thought.trim().to_owned())
}

#[cfg(test)]
mod tests {
    //! Contract: what a model thinks aloud is no part of its answer.
    use super::*;

    #[test]
    fn thoughts_are_taken_out() {
        let split = |text: &str| split_thought(text);
        let pair = |answer: &str, thought: &str| (answer.to_owned(), thought.to_owned());
        assert_eq!(split("{\"a\": 1}"), pair("{\"a\": 1}", ""));
        assert_eq!(split("<think>maybe {\"a\": 2}</think>\n{\"a\": 1}"), pair("{\"a\": 1}", "maybe {\"a\": 2}"));
        assert_eq!(split("so {\"a\": 2}</think>{\"a\": 1}"), pair("{\"a\": 1}", "so {\"a\": 2}"));
        assert_eq!(split("<think>on and on {\"a\": 2}"), pair("", "on and on {\"a\": 2}"));
        assert_eq!(split("<think>a</think>x<thinking>b</thinking>y"), pair("xy", "ab"));
    }
}
