//! What would not fit into memory is refused before it is tried.

use crate::failure::{Failure, Result};

/// Refuses what needs more bytes than this machine has. `bytes` is what is surely needed; products that overflow are none.
///
/// # Errors
/// [`Failure::Input`] with both amounts.
pub fn check(what: &str, bytes: Option<u128>) -> Result<()> {
    match complaint(bytes) {
        None => Ok(()),
        Some(amounts) => Err(Failure::input(format!("{what} {amounts}"), "ask for less")),
    }
}

/// What stands against so many bytes, if anything does.
pub fn complaint(bytes: Option<u128>) -> Option<String> {
    complaint_of(bytes, scrnn_data::memory::of_machine().map(u128::from))
}

fn complaint_of(bytes: Option<u128>, machine: Option<u128>) -> Option<String> {
    // Half of what can be addressed is the most that any allocation may have.
    let most = machine.unwrap_or(u128::from(u64::MAX) >> 1);
    match bytes {
        Some(bytes) if bytes <= most => None,
        Some(bytes) => Some(format!("needs {}; this machine has {}", amount(bytes), amount(most))),
        None => Some(format!("needs more than {}; this machine has {}", amount(u128::MAX), amount(most))),
    }
}

/// The product, if it is one.
pub fn product(factors: &[usize]) -> Option<u128> {
    factors.iter().try_fold(1_u128, |product, &factor| product.checked_mul(factor as u128))
}

fn amount(bytes: u128) -> String {
    match bytes {
        0..1_000_000_000 => format!("{:.1} MB", bytes as f64 / 1e6),
        1_000_000_000..1_000_000_000_000_000 => format!("{:.1} GB", bytes as f64 / 1e9),
        _ => format!("{:.1e} GB", bytes as f64 / 1e9),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_told_with_both_amounts() {
        let machine = Some(24_000_000_000);
        assert_eq!(complaint_of(Some(24_000_000_000), machine), None);
        assert_eq!(complaint_of(Some(34_000_000_000), machine).unwrap(), "needs 34.0 GB; this machine has 24.0 GB");
        assert!(complaint_of(product(&[usize::MAX; 3]), machine).unwrap().starts_with("needs more than"));
        assert!(complaint_of(product(&[usize::MAX; 2]), None).is_some() && complaint_of(Some(1 << 40), None).is_none());
    }
}
