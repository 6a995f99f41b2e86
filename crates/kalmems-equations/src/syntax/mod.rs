//! The text of an expression: its tokens, and its terms.

mod parse;
mod token;
mod tree;

pub(crate) use parse::parse;
pub(crate) use token::{is_first_of_name, is_of_name};
pub(crate) use tree::{SyntaxTree, TermForm, TermId};
