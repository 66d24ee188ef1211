//! Comma-separated values (RFC 4180): quoted fields, doubled quotes, line breaks within quotes.

use thiserror::Error;

/// Text that is no table.
#[derive(Debug, Error)]
pub enum CsvError {
    /// There is no first line with names.
    #[error("line 1: the names of the columns are missing")]
    Empty,
    /// A quote is never closed.
    #[error("line {line}: a quoted field does not end")]
    OpenQuote {
        /// Line on which the row begins, from 1.
        line: usize,
    },
    /// A row has another number of fields than the first line.
    #[error("line {line}: {found} fields, expected {expected}")]
    Width {
        /// Line on which the row begins, from 1.
        line: usize,
        /// Fields of the row.
        found: usize,
        /// Fields of the first line.
        expected: usize,
    },
    /// A column is not there.
    #[error("line 1: no column `{name}`; columns: {known}")]
    Column {
        /// The column.
        name: String,
        /// All columns.
        known: String,
    },
}

/// One row.
pub(super) struct Row {
    /// Line on which it begins, from 1.
    pub(super) line: usize,
    /// Its fields, as many as there are columns.
    pub(super) fields: Vec<String>,
}

/// A table with names of its columns.
pub(super) struct Table {
    names: Vec<String>,
    /// The rows after the first line.
    pub(super) rows: Vec<Row>,
}

impl Table {
    /// Reads a table; empty lines are left out.
    pub(super) fn read(text: &str) -> Result<Self, CsvError> {
        let mut rows = split(text)?.into_iter();
        let names = rows.next().ok_or(CsvError::Empty)?.fields;
        let rows: Vec<Row> = rows.collect();
        let width = names.len();
        match rows.iter().find(|row| row.fields.len() != width) {
            Some(row) => Err(CsvError::Width { line: row.line, found: row.fields.len(), expected: width }),
            None => Ok(Self { names: names.into_iter().map(|name| name.trim().to_owned()).collect(), rows }),
        }
    }

    /// Place of a column.
    pub(super) fn column(&self, name: &str) -> Result<usize, CsvError> {
        let found = self.names.iter().position(|known| known == name);
        found.ok_or_else(|| CsvError::Column { name: name.to_owned(), known: self.names.join(", ") })
    }
}

fn split(text: &str) -> Result<Vec<Row>, CsvError> {
    let (mut rows, mut fields, mut field) = (Vec::new(), Vec::new(), String::new());
    let (mut line, mut begin, mut quoted) = (1, 1, false);
    let mut chars = text.trim_start_matches('\u{feff}').chars().peekable();
    while let Some(c) = chars.next() {
        line += usize::from(c == '\n');
        match c {
            '"' if quoted && chars.peek() == Some(&'"') => {
                chars.next();
                field.push('"');
            }
            '"' if quoted || field.is_empty() => quoted = !quoted,
            ',' if !quoted => fields.push(std::mem::take(&mut field)),
            '\r' if !quoted && chars.peek() == Some(&'\n') => {}
            '\n' if !quoted => {
                fields.push(std::mem::take(&mut field));
                let row = Row { line: begin, fields: std::mem::take(&mut fields) };
                rows.extend(Some(row).filter(|row| row.fields != [""]));
                begin = line;
            }
            c => field.push(c),
        }
    }
    if quoted {
        return Err(CsvError::OpenQuote { line: begin });
    }
    fields.push(field);
    rows.extend(Some(Row { line: begin, fields }).filter(|row| row.fields != [""]));
    Ok(rows)
}
