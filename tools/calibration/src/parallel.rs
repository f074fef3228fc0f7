//! Independent jobs on all cores.
//!
//! The thread pool sees one closure type only, so its code is compiled once for the whole crate.

use std::sync::Mutex;

use rayon::prelude::*;

/// Results of `job(0)` to `job(count - 1)` in order, the same on any number of threads.
pub fn map<T: Send>(count: usize, job: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let results: Vec<Mutex<Option<T>>> = (0..count).map(|_| Mutex::new(None)).collect();
    run(count, &|index| {
        let result = job(index);
        if let Ok(mut slot) = results[index].lock() {
            *slot = Some(result);
        }
    });
    // A job that panics ends the whole run, so every slot is filled.
    let filled = results.into_iter();
    filled.filter_map(|slot| slot.into_inner().ok()?).collect()
}

fn run(count: usize, job: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().with_max_len(1).for_each(job);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_in_order() {
        assert_eq!(map(100, |i| i * i), (0..100).map(|i| i * i).collect::<Vec<_>>());
        assert!(map(0, |i| i).is_empty());
    }
}
