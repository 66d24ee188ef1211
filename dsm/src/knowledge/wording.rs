//! Spelling: one form for every way to write a name.

/// Longest name, in characters, that is looked at; the rest is cut off.
const MAX_NAME_CHARS: usize = 80;

/// Lower case, single spaces, `_` and `-` as spaces, and nothing but letters, digits, spaces and apostrophes.
pub fn normalize(name: &str) -> String {
    let mut out = String::with_capacity(name.len().min(MAX_NAME_CHARS));
    for c in name.chars().take(MAX_NAME_CHARS).flat_map(char::to_lowercase) {
        if c.is_alphanumeric() || c == '\'' {
            out.push(c);
        } else if !out.is_empty() && !out.ends_with(' ') {
            out.push(' ');
        }
    }
    out.truncate(out.trim_end().len());
    out
}

/// The likely singular forms of an English phrase, best first; its last word is changed. Empty when it looks singular.
pub fn singular_of(phrase: &str) -> Vec<String> {
    let mut forms = Vec::new();
    let mut push = |ending: &str, replacement: &str| {
        if let Some(stem) = phrase.strip_suffix(ending).filter(|stem| stem.chars().count() >= 2) {
            forms.push(format!("{stem}{replacement}"));
        }
    };
    push("'s", "");
    push("ies", "y");
    push("ves", "f");
    push("ves", "fe");
    push("men", "man");
    push("ches", "ch");
    push("shes", "sh");
    push("sses", "ss");
    push("xes", "x");
    push("oes", "o");
    if !phrase.ends_with("ss") {
        push("s", "");
    }
    forms
}

#[cfg(test)]
mod tests {
    //! Contract: case, hyphens and plural do not change a name.
    use super::*;

    #[test]
    fn spelling_variants_meet() {
        assert_eq!(normalize("  White-Board_2\t"), "white board 2");
        assert_eq!(normalize("\u{0}\u{7}"), "");
        assert!(singular_of("shelves").contains(&"shelf".to_owned()));
        assert!(singular_of("knives").contains(&"knife".to_owned()));
        assert!(singular_of("boxes").contains(&"box".to_owned()));
        assert!(singular_of("wine glasses").contains(&"wine glass".to_owned()));
        assert!(singular_of("glass").is_empty());
    }
}
