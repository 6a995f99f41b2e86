//! What a browser lets an answer do.
//!
//! Results are received from others, and a page of one can hold anything. So it is shown in a frame of another origin, under an address that
//! tells the files of its own result alone, by a page that lets the frame go nowhere else; and of scripts it runs those alone that this program writes
//! into its reports.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use kalmems::figures::page_scripts;
use sha2::{Digest, Sha256};

/// What every answer says: no other page may embed it or learn its address.
pub const COMMON: [&str; 6] = [
    "Cache-Control: no-store",
    "Connection: close",
    "Cross-Origin-Opener-Policy: same-origin",
    "Referrer-Policy: no-referrer",
    "X-Content-Type-Options: nosniff",
    "X-DNS-Prefetch-Control: off",
];

/// Who an answer is for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PagePolicy {
    /// The list of results, and files that are looked at by themselves: nothing runs and nothing is loaded.
    Alone,
    /// A page with a frame, which shows files of the result of this token alone.
    Frame { host: String, token: String },
    /// A file of a result that is shown in such a frame: a page runs the scripts of reports and reads files of its own result, and nothing else.
    OfResult { host: String, token: String },
}

impl PagePolicy {
    /// The lines that say so.
    pub fn lines(&self) -> Vec<String> {
        let nothing = "default-src 'none'; base-uri 'none'; form-action 'none'; style-src 'unsafe-inline'; img-src data:";
        let (policy, embedded) = match self {
            Self::Alone => (format!("{nothing}; sandbox; frame-ancestors 'none'"), "same-origin"),
            Self::Frame { host, token } => (
                format!("{nothing}; frame-src http://{host}/{token}/; frame-ancestors 'none'"),
                "same-origin",
            ),
            Self::OfResult { host, token } => {
                let [plots, page] = page_scripts().map(|script| digest(&script));
                let own = format!("http://{host}/{token}/");
                let policy = format!(
                    "{nothing}; sandbox allow-scripts allow-downloads; script-src '{plots}' '{page}'; connect-src {own}; frame-ancestors http://{host}"
                );
                (policy, "cross-origin")
            }
        };
        let mut lines = vec![
            format!("Content-Security-Policy: {policy}"),
            format!("Cross-Origin-Resource-Policy: {embedded}"),
        ];
        if matches!(self, Self::OfResult { .. }) {
            // A page in a sandbox has no origin of its own.
            lines.push("Access-Control-Allow-Origin: null".to_owned());
        }
        lines
    }
}

/// The digest of a script, as a policy names it.
fn digest(script: &str) -> String {
    format!("sha256-{}", STANDARD.encode(Sha256::digest(script.as_bytes())))
}
