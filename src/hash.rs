//! Hashes as text.

use sha2::{Digest, Sha256};

/// The digits of a hash, in base 16.
pub(crate) fn hexadecimal(hash: Sha256) -> String {
    let bytes: [u8; 32] = hash.finalize().into();
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
