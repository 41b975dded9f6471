//! A letter box: one mutex around everything that can be new, and a way to wake its one reader.
//!
//! The reader looks for news under that very mutex before it sleeps, and whoever brings some holds it while
//! knocking: no wake-up can be lost, and there is no second monitor to lock in another order.
//! `tests/handover.rs` compiles this file against a model checker's locks and tries every order in which
//! three threads can use it.

use std::sync::PoisonError;

use super::sync::{Condvar, Mutex, MutexGuard, Notify};

/// A letter box with mail of the kind `M`.
#[derive(Debug)]
pub struct MailBox<M> {
    mail: Mutex<M>,
    news: Condvar,
    /// The same for a reader that is a task. Stores one permit: a wake-up before the wait is not lost.
    told: Notify,
}

impl<M> MailBox<M> {
    /// A box with that mail in it, which is no news.
    pub fn new(mail: M) -> Self {
        Self { mail: Mutex::new(mail), news: Condvar::new(), told: Notify::new() }
    }

    /// Changes the mail. `change` also tells whether that is news to the reader.
    pub fn put<T>(&self, change: impl FnOnce(&mut M) -> (T, bool)) -> T {
        let mut mail = self.lock();
        let (result, is_news) = change(&mut mail);
        if is_news {
            self.news.notify_one();
            self.told.notify_one();
        }
        result
    }

    /// Looks at the mail.
    pub fn look<T>(&self, look: impl FnOnce(&M) -> T) -> T {
        look(&self.lock())
    }

    /// Takes what `collect` finds new, if that is anything.
    pub fn try_take<T>(&self, collect: impl FnOnce(&mut M) -> Option<T>) -> Option<T> {
        collect(&mut self.lock())
    }

    /// Waits until `collect` finds something new.
    pub fn take<T>(&self, mut collect: impl FnMut(&mut M) -> Option<T>) -> T {
        let mut mail = self.lock();
        loop {
            if let Some(found) = collect(&mut mail) {
                return found;
            }
            mail = self.news.wait(mail).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// The same for a reader that is a task. May be broken off at any time: nothing is lost.
    pub async fn taken<T>(&self, mut collect: impl FnMut(&mut M) -> Option<T>) -> T {
        loop {
            if let Some(found) = self.try_take(&mut collect) {
                return found;
            }
            self.told().await;
        }
    }

    /// Ends once there has been news since the last call that ended.
    pub async fn told(&self) {
        self.told.notified().await;
    }

    /// A thread that panicked while it held the lock leaves whole values behind: every change is a
    /// move.
    fn lock(&self) -> MutexGuard<'_, M> {
        self.mail.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
