use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use protocol::security::Caller;
use tokio_util::sync::{CancellationToken, WaitForCancellationFutureOwned};

/// Part of the places that callers cannot take before they are trusted.
const KEPT: usize = 4;

/// The places of connections. A caller that is not trusted yet has one as long as nobody else needs it: when places run short, the one
/// that has waited longest gives way, so that strangers cannot shut others out.
pub(super) struct Places {
    most: usize,
    taken: Mutex<Taken>,
}

#[derive(Default)]
struct Taken {
    next: u64,
    /// By the order in which they came.
    callers: BTreeMap<u64, (Caller, CancellationToken)>,
}

/// The place of one connection; dropping it gives it back.
pub(super) struct Place {
    places: Arc<Places>,
    number: u64,
    loss: CancellationToken,
}

impl Places {
    pub(super) fn new(most: usize) -> Arc<Self> {
        Arc::new(Self { most, taken: Mutex::default() })
    }

    /// A place for this caller; `None` where trusted ones have them all.
    pub(super) fn take(self: &Arc<Self>, caller: &Caller) -> Option<Place> {
        let mut taken = self.lock();
        let strangers = taken.callers.values().filter(|(caller, _)| !caller.is_trusted()).count();
        let for_strangers = self.most - self.most / KEPT;
        if taken.callers.len() >= self.most || (!caller.is_trusted() && strangers >= for_strangers) {
            let oldest = taken.callers.iter().find(|(_, (caller, _))| !caller.is_trusted());
            let oldest = oldest.map(|(number, _)| *number)?;
            let (_, loss) = taken.callers.remove(&oldest)?;
            loss.cancel();
        }
        let (number, loss) = (taken.next, CancellationToken::new());
        taken.next += 1;
        taken.callers.insert(number, (caller.clone(), loss.clone()));
        Some(Place { places: Arc::clone(self), number, loss })
    }

    fn lock(&self) -> MutexGuard<'_, Taken> {
        // No code that holds the lock leaves it half changed.
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Place {
    /// Ends when another caller has taken the place.
    pub(super) fn lost(&self) -> WaitForCancellationFutureOwned {
        self.loss.clone().cancelled_owned()
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.places.lock().callers.remove(&self.number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stranger() -> Caller {
        Caller::new(None)
    }

    fn trusted() -> Caller {
        let caller = stranger();
        caller.trust();
        caller
    }

    #[test]
    fn strangers_give_way_to_those_who_come_later() {
        let places = Places::new(8);
        let all: Vec<Place> = (0..20).map(|_| places.take(&stranger()).unwrap()).collect();
        // A quarter of the places is not for them.
        let stay = |place: &&Place| !place.loss.is_cancelled();
        assert_eq!(all.iter().filter(stay).count(), 6);
        assert!(all[14..].iter().all(|place| stay(&place)), "the last that came stay");
    }

    #[test]
    fn the_trusted_keep_their_places() {
        let places = Places::new(8);
        let (first, late) = (stranger(), stranger());
        let old = places.take(&first).unwrap();
        let friends: Vec<Place> = (0..5).map(|_| places.take(&trusted()).unwrap()).collect();
        first.trust();
        let one = places.take(&stranger()).unwrap();
        let other = places.take(&stranger()).unwrap();
        let newest = places.take(&late).unwrap();
        assert!(one.loss.is_cancelled() && !other.loss.is_cancelled() && !newest.loss.is_cancelled());
        assert!(!old.loss.is_cancelled() && friends.iter().all(|place| !place.loss.is_cancelled()));
        // All places are trusted ones': nobody else comes in until one leaves.
        let last = [places.take(&trusted()).unwrap(), places.take(&trusted()).unwrap()];
        assert!(other.loss.is_cancelled() && newest.loss.is_cancelled());
        assert!(places.take(&stranger()).is_none() && places.take(&trusted()).is_none());
        drop(last);
        assert!(places.take(&stranger()).is_some());
    }
}
