//! What can go wrong when a report is written.

/// A picture or a page that cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// More panels than a PNG of reasonable size can hold.
    #[error(
        "the figure `{figure}` would be {height} pixels high; at most {limit} fit: give it fewer panels or \
         write it as SVG"
    )]
    TooHigh {
        /// The name of the figure.
        figure: String,
        /// Its height in pixels.
        height: u32,
        /// The limit.
        limit: u32,
    },
    /// The encoder refused.
    #[error("cannot write the figure `{figure}` as PNG: {why}")]
    Png {
        /// The name of the figure.
        figure: String,
        /// What the encoder says.
        why: String,
    },
    /// The template of the page could not be filled in.
    #[error("cannot write the report page: {0}")]
    Page(#[from] minijinja::Error),
}
