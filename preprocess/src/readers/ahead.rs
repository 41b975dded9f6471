//! Reading ahead: the next batch is decoded on rayon's pool while the caller takes this one.
//!
//! A reader's sink runs on the calling thread only and in order, yet decoding should neither wait
//! for it nor run away from it: at most two batches are alive, one being taken, one being made.

use crate::error::Result;

/// Calls `produce` until it gives `None`, and `consume` with each batch, in order.
///
/// `produce` runs on the current rayon pool, one batch ahead of `consume`, which runs on the
/// calling thread. Ends at the first error of either; an error of `produce` is returned after the
/// batches before it were consumed.
pub(super) fn run_ahead<T: Send>(
    mut produce: impl FnMut() -> Result<Option<T>> + Send,
    mut consume: impl FnMut(T) -> Result<()>,
) -> Result<()> {
    let mut current = produce()?;
    while let Some(batch) = current {
        let mut next = Ok(None);
        let consumed = rayon::in_place_scope(|scope| {
            scope.spawn(|_| next = produce());
            consume(batch)
        });
        consumed?;
        current = next?;
    }
    Ok(())
}

/// Parts of a batch: enough that every thread of the pool has work and a short part does not
/// leave the others idle.
pub(super) fn batch_parts() -> usize {
    2 * rayon::current_num_threads()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Error;

    #[test]
    fn batches_arrive_once_and_in_order() {
        let mut next = 0;
        let mut seen = Vec::new();
        let produce = || {
            next += 1;
            Ok((next <= 100).then_some(next))
        };
        run_ahead(produce, |batch| {
            seen.push(batch);
            Ok(())
        })
        .expect("nothing fails");
        assert_eq!(seen, (1..=100).collect::<Vec<_>>());
    }

    #[test]
    fn consumes_what_came_before_an_error_of_produce() {
        let mut next = 0;
        let mut seen = Vec::new();
        let produce = || {
            next += 1;
            if next == 4 { Err(Error::input("cloud", "broken")) } else { Ok(Some(next)) }
        };
        let ended = run_ahead(produce, |batch| {
            seen.push(batch);
            Ok(())
        });
        assert!(ended.is_err());
        assert_eq!(seen, [1, 2, 3]);
    }

    #[test]
    fn stops_at_the_first_error_of_consume() {
        let mut taken = 0;
        let ended = run_ahead(
            || Ok(Some(())),
            |()| {
                taken += 1;
                if taken == 3 { Err(Error::Interrupted) } else { Ok(()) }
            },
        );
        assert!(matches!(ended, Err(Error::Interrupted)));
        assert_eq!(taken, 3);
    }
}
