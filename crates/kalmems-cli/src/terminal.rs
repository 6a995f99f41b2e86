//! What standard output is written to: a terminal of so many columns, with colours or without.

use std::borrow::Cow;

/// The colours of a terminal for words that say how serious something is, by their numbers in its control sequences.
const COLOURS: [(&str, u8); 11] = [
    ("FAILURE:", 31),
    ("WARNING:", 33),
    ("ok:", 32),
    ("passes with remarks", 36),
    ("passes", 32),
    ("doubtful", 33),
    ("failed", 31),
    ("no estimate", 31),
    ("LOST LOCK", 31),
    ("WRONG SIGN", 31),
    ("astray", 31),
];

/// The columns of the terminal; as many as it takes if standard output is none.
#[cfg(not(target_family = "wasm"))]
pub fn columns() -> usize {
    /// A terminal that claims fewer has no size.
    const FEWEST: u16 = 40;
    let size = console::Term::stdout().size_checked();
    size.map(|(_, columns)| columns).filter(|columns| *columns >= FEWEST).map_or(usize::MAX, usize::from)
}

/// As many columns as it takes: a page has no terminal.
#[cfg(target_family = "wasm")]
pub fn columns() -> usize {
    usize::MAX
}

/// A text in which the words that say how serious something is have their colours, if standard output is a terminal that shows them and
/// `NO_COLOR` does not forbid it.
pub fn coloured(text: &str) -> Cow<'_, str> {
    use std::io::IsTerminal;
    let is_set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    let is_dumb = std::env::var_os("TERM").is_none_or(|terminal| terminal == "dumb");
    if is_set("NO_COLOR") || is_dumb || !std::io::stdout().is_terminal() {
        return Cow::Borrowed(text);
    }
    Cow::Owned(text.split_inclusive('\n').map(coloured_line).collect())
}

/// A line whose first word is such a word, or one of whose cells is one: cells end with two spaces or with the line.
fn coloured_line(line: &str) -> String {
    let (text, end) = line.strip_suffix('\n').map_or((line, ""), |text| (text, "\n"));
    for (words, colour) in COLOURS {
        let is_mark = words.ends_with(':');
        let place = if is_mark { text.strip_prefix(words).map(|_| 0) } else { place_of_cell(text, words) };
        if let Some((before, after)) = place.map(|place| (&text[..place], &text[place + words.len()..])) {
            return format!("{before}\u{1b}[{colour}m{words}\u{1b}[0m{after}{end}");
        }
    }
    line.to_owned()
}

fn place_of_cell(line: &str, words: &str) -> Option<usize> {
    line.match_indices(words).map(|(place, _)| place).find(|place| {
        let (before, after) = (&line[..*place], &line[*place + words.len()..]);
        before.ends_with("  ") && (after.is_empty() || after.starts_with("  "))
    })
}

#[cfg(test)]
mod tests {
    use super::coloured_line;

    #[test]
    fn marks_and_cells_have_colours_and_sentences_have_none() {
        let coloured = |line: &str| coloured_line(line).replace('\u{1b}', "^");
        assert_eq!(coloured("FAILURE: EKF: failed: it\n"), "^[31mFAILURE:^[0m EKF: failed: it\n");
        assert_eq!(coloured("EKF  1.072  doubtful  2 µs\n"), "EKF  1.072  ^[33mdoubtful^[0m  2 µs\n");
        assert_eq!(coloured("EKF  1.00  passes with remarks"), "EKF  1.00  ^[36mpasses with remarks^[0m");
        assert_eq!(coloured("a filter passes if it can"), "a filter passes if it can");
    }
}
