//! A memory on disks that fail, and in files that were touched.

mod cuts;
pub(crate) mod faulty;
mod files;
mod scribes;

use std::path::Path;
use std::sync::Arc;

use gestalt_protocol::RobotId;
use gestalt_strategies::RecordChange;

use super::{FilePlace, Place, Records, Store, StoreError};

const ME: RobotId = RobotId(7);

fn place(path: &Path) -> Arc<dyn Place> {
    Arc::new(FilePlace::new(path.to_owned()))
}

fn open(path: &Path) -> Result<Store, StoreError> {
    Store::open(place(path), ME, 1).map(|(store, _)| store)
}

fn change(key: u8, value: Option<u8>) -> RecordChange {
    RecordChange { key: vec![key], value: value.map(|value| vec![value; 40]) }
}

/// What the records come to after these changes.
fn applied(records: &mut Records, changes: &[RecordChange]) {
    for RecordChange { key, value } in changes {
        match value {
            Some(value) => records.insert(key.clone(), value.clone()),
            None => records.remove(key),
        };
    }
}
