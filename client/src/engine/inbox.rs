//! The letter boxes of the two threads (`mailbox.rs`).
//!
//! The view, the settings and the demand are latest-wins; events queue up, bounded by the loader, which
//! stops asking while too much of what it delivered is unread.

use super::{
    event::Event, mailbox::MailBox, occlusion::Drawn, piece::Piece, settings::Settings, view::View,
};
use crate::source::Source;

/// What the traversal thread reads.
#[derive(Debug)]
pub(super) struct TraversalInbox(MailBox<TraversalMail>);

/// The newest of everything.
#[derive(Debug)]
pub(super) struct TraversalMail {
    /// The view, and how often it has changed.
    pub view: Option<View>,
    /// Wanted attributes, where they have changed.
    pub attributes: Option<Vec<String>>,
    /// The settings.
    pub settings: Settings,
    /// Counts changes of the view, the attributes, the settings and the clouds.
    pub generation: u64,
    /// The newest picture, where one has been drawn since.
    pub drawn: Option<Drawn>,
    /// From the loader, and from the caller where clouds come and go; oldest first.
    pub events: Vec<Event>,
    /// Events ever posted.
    pub posted: u64,
    /// Whether to end.
    pub shutdown: bool,
    /// Whether the view or a setting is new.
    is_changed: bool,
}

impl TraversalInbox {
    pub fn new(settings: Settings) -> Self {
        Self(MailBox::new(TraversalMail {
            view: None,
            attributes: None,
            settings,
            generation: 0,
            drawn: None,
            events: Vec::new(),
            posted: 0,
            shutdown: false,
            is_changed: false,
        }))
    }

    /// Sets the view; the same view again is no news. Calls `changed` with the new generation
    /// before the traversal can see it. Returns the generation.
    pub fn set_view(&self, view: View, changed: impl FnOnce(u64)) -> u64 {
        self.change(changed, |mail| {
            let is_news = mail.view != Some(view);
            mail.view = Some(view);
            mail.is_changed |= is_news;
            is_news
        })
    }

    /// Sets the wanted attributes. Returns the generation.
    pub fn set_attributes(&self, attributes: Vec<String>, changed: impl FnOnce(u64)) -> u64 {
        self.change(changed, |mail| {
            mail.attributes = Some(attributes);
            true
        })
    }

    /// Changes the settings; the same settings again are no news. Returns the generation.
    pub fn set(&self, set: impl FnOnce(&mut Settings), changed: impl FnOnce(u64)) -> u64 {
        self.change(changed, |mail| {
            let before = mail.settings.clone();
            set(&mut mail.settings);
            let is_news = mail.settings != before;
            mail.is_changed |= is_news;
            is_news
        })
    }

    /// Posts that a cloud comes or goes.
    pub fn change_clouds(&self, event: Event, changed: impl FnOnce(u64)) {
        self.change(changed, |mail| {
            mail.push(event);
            true
        });
    }

    /// Changes what the caller wants; `change` tells whether that is news.
    fn change(
        &self,
        changed: impl FnOnce(u64),
        change: impl FnOnce(&mut TraversalMail) -> bool,
    ) -> u64 {
        self.0.put(|mail| {
            let is_news = change(mail);
            if is_news {
                mail.generation += 1;
                changed(mail.generation);
            }
            (mail.generation, is_news)
        })
    }

    /// Tells of a picture; one that was not read yet is forgotten.
    pub fn set_drawn(&self, drawn: Drawn) {
        self.0.put(|mail| (mail.drawn = Some(drawn), true));
    }

    /// The newest generation, and whether there is a view at all.
    pub fn generation(&self) -> (u64, bool) {
        self.0.look(|mail| (mail.generation, mail.view.is_some()))
    }

    /// Posts an event; returns its number, counting from 1.
    pub fn post(&self, event: Event) -> u64 {
        self.0.put(|mail| (mail.push(event), true))
    }

    /// Tells the thread to end.
    pub fn shut_down(&self) {
        self.0.put(|mail| (mail.shutdown = true, true));
    }

    /// Waits for news and takes all of it.
    pub fn take(&self) -> TraversalMail {
        self.0.take(TraversalMail::collect)
    }

    /// Takes all there is, if that is anything.
    pub fn try_take(&self) -> Option<TraversalMail> {
        self.0.try_take(TraversalMail::collect)
    }

    /// Ends once something has been posted since the last call that ended.
    pub async fn posted(&self) {
        self.0.told().await;
    }
}

impl TraversalMail {
    const fn is_news(&self) -> bool {
        !self.events.is_empty()
            || self.attributes.is_some()
            || self.drawn.is_some()
            || self.is_changed
            || self.shutdown
    }

    /// Adds an event; returns its number.
    fn push(&mut self, event: Event) -> u64 {
        self.events.push(event);
        self.posted += 1;
        self.posted
    }

    /// All there is, if that is anything.
    fn collect(&mut self) -> Option<Self> {
        if !self.is_news() {
            return None;
        }
        self.is_changed = false;
        Some(Self {
            view: self.view,
            attributes: self.attributes.take(),
            settings: self.settings.clone(),
            generation: self.generation,
            drawn: self.drawn.take(),
            events: std::mem::take(&mut self.events),
            posted: self.posted,
            shutdown: self.shutdown,
            is_changed: false,
        })
    }
}

/// What the traversal wants loaded.
#[derive(Debug, Default)]
pub(super) struct Demand {
    /// Most important first.
    pub pieces: Vec<Piece>,
    /// Events that the traversal had read when it wrote this.
    pub seen: u64,
}

/// What the caller wants of the loader.
#[derive(Debug)]
pub(super) enum Change {
    /// Another cloud.
    Add { cloud: usize, number: usize, source: Source },
    /// One less.
    Remove { number: usize },
    /// Another try to open one, at once.
    Reopen { number: usize },
}

/// What the loader thread reads.
#[derive(Debug)]
pub(super) struct LoaderInbox(MailBox<LoaderMail>);

/// The newest demand.
#[derive(Debug, Default)]
pub(super) struct LoaderMail {
    /// Replaces the one before.
    pub demand: Option<Demand>,
    /// Oldest first.
    pub changes: Vec<Change>,
    /// Whether to end.
    pub shutdown: bool,
}

impl LoaderInbox {
    pub fn new() -> Self {
        Self(MailBox::new(LoaderMail::default()))
    }

    /// Replaces the demand.
    pub fn set_demand(&self, demand: Demand) {
        self.0.put(|mail| (mail.demand = Some(demand), true));
    }

    /// Posts a change.
    pub fn change(&self, change: Change) {
        self.0.put(|mail| (mail.changes.push(change), true));
    }

    /// Tells the thread to end.
    pub fn shut_down(&self) {
        self.0.put(|mail| (mail.shutdown = true, true));
    }

    /// Waits for news and takes all of it.
    pub async fn take(&self) -> LoaderMail {
        self.0.taken(LoaderMail::collect).await
    }
}

impl LoaderMail {
    fn collect(&mut self) -> Option<Self> {
        let is_news = self.demand.is_some() || !self.changes.is_empty() || self.shutdown;
        is_news.then(|| std::mem::take(self))
    }
}
