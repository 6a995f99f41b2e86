//! `kalmems schema`.

use crate::{Ending, print};

pub fn run() -> Result<(), Ending> {
    let schema = serde_json::to_string_pretty(&kalmems::config::schema());
    print(&(schema.map_err(|e| Ending::Wrong(e.to_string()))? + "\n"))
}
