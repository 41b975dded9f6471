//! Which of the wanted nodes are drawn now, and which must still be loaded.

use lodestream_protocol::Refinement;

use super::selection::Pick;

/// What is there of a wanted node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Presence {
    /// Its positions are loaded.
    Drawable,
    /// Not yet.
    Absent,
    /// Never: its bytes are damaged or cannot be had.
    Lost,
}

/// Indices into the picks.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Drawing {
    /// To draw now.
    pub drawn: Vec<usize>,
    /// To keep if loaded, to load if not.
    pub needed: Vec<usize>,
}

/// Decides for every pick; `picks` hold ancestors before descendants.
///
/// Additive: a node is drawn once all above it are; one that is lost stands in nobody's way.
/// Replacing: a node is drawn until all of its family are there to stand in for it, so there is
/// never a hole; a family with a lost member never takes over.
pub(super) fn draw(picks: &[Pick], presence: impl Fn(&Pick) -> Presence) -> Drawing {
    let presence: Vec<_> = picks.iter().map(presence).collect();
    // Whether a node, or what stands in for it, is there. Children come after their parents.
    let mut covered = vec![false; picks.len()];
    let mut replaced = vec![false; picks.len()];
    for (i, pick) in picks.iter().enumerate().rev() {
        replaced[i] = pick.family.clone().is_some_and(|mut family| family.all(|c| covered[c]));
        covered[i] = replaced[i] || presence[i] == Presence::Drawable;
    }
    // Whether the nodes above let those below be drawn.
    let mut open = vec![false; picks.len()];
    let mut drawing = Drawing::default();
    for (i, pick) in picks.iter().enumerate() {
        let reachable = pick.parent.is_none_or(|parent| open[parent]);
        let drawn = reachable && presence[i] == Presence::Drawable && !replaced[i];
        open[i] = reachable
            && match pick.refinement {
                Refinement::Additive => presence[i] != Presence::Absent,
                // Where the node itself is missing, whatever there is below is better than nothing.
                Refinement::Replace => !drawn,
            };
        if drawn {
            drawing.drawn.push(i);
        }
        if !replaced[i] {
            drawing.needed.push(i);
        }
    }
    drawing
}

#[cfg(test)]
mod tests {
    use std::{ops::Range, sync::Arc};

    use lodestream_protocol::NodeKey;

    use super::{
        Presence::{Absent, Drawable, Lost},
        *,
    };
    use crate::engine::{piece::NodeId, testing::node};

    fn pick(refinement: Refinement, parent: Option<usize>, family: Option<Range<usize>>) -> Pick {
        let node = Arc::new(node(NodeKey::ROOT));
        let id = NodeId { cloud: 0, key: node.key };
        let (priority, urgency, reserved) = (1.0, 1.0, 1);
        let is_exact = false;
        Pick { id, node, refinement, parent, family, priority, urgency, reserved, is_exact }
    }

    /// Two levels below a root: 0 → 1, 2; 1 → 3, 4.
    fn picks(refinement: Refinement) -> Vec<Pick> {
        let family = |range| (refinement == Refinement::Replace).then_some(range);
        vec![
            pick(refinement, None, family(1..3)),
            pick(refinement, Some(0), family(3..5)),
            pick(refinement, Some(0), None),
            pick(refinement, Some(1), None),
            pick(refinement, Some(1), None),
        ]
    }

    fn drawing(refinement: Refinement, presence: [Presence; 5]) -> Drawing {
        let picks = picks(refinement);
        let index = |pick: &Pick| picks.iter().position(|p| std::ptr::eq(p, pick));
        draw(&picks, |pick| presence[index(pick).expect("one of them")])
    }

    fn check(refinement: Refinement, presence: [Presence; 5], drawn: &[usize], needed: &[usize]) {
        let found = drawing(refinement, presence);
        assert_eq!((found.drawn.as_slice(), found.needed.as_slice()), (drawn, needed));
    }

    const ALL: [usize; 5] = [0, 1, 2, 3, 4];

    #[test]
    fn additive_nodes_wait_for_all_above_them() {
        let additive = Refinement::Additive;
        check(additive, [Drawable; 5], &ALL, &ALL);
        check(additive, [Absent, Drawable, Drawable, Drawable, Drawable], &[], &ALL);
        check(additive, [Drawable, Absent, Drawable, Drawable, Drawable], &[0, 2], &ALL);
    }

    #[test]
    fn an_additive_node_that_is_lost_hides_only_itself() {
        let presence = [Drawable, Lost, Drawable, Drawable, Absent];
        check(Refinement::Additive, presence, &[0, 2, 3], &ALL);
    }

    #[test]
    fn a_replaced_node_stays_until_all_stand_ins_are_there() {
        let replace = Refinement::Replace;
        check(replace, [Drawable, Absent, Absent, Absent, Absent], &[0], &ALL);
        check(replace, [Drawable, Drawable, Absent, Drawable, Absent], &[0], &ALL);
        check(replace, [Drawable, Drawable, Drawable, Drawable, Absent], &[1, 2], &[1, 2, 3, 4]);
        check(replace, [Drawable, Absent, Drawable, Drawable, Drawable], &[2, 3, 4], &[2, 3, 4]);
        check(replace, [Absent, Absent, Drawable, Drawable, Drawable], &[2, 3, 4], &[2, 3, 4]);
    }

    #[test]
    fn a_family_with_a_lost_member_never_takes_over() {
        let presence = [Drawable, Drawable, Drawable, Lost, Drawable];
        check(Refinement::Replace, presence, &[1, 2], &[1, 2, 3, 4]);
    }

    #[test]
    fn while_a_replaced_node_is_missing_what_there_is_below_it_is_drawn() {
        check(Refinement::Replace, [Absent, Absent, Drawable, Absent, Drawable], &[2, 4], &ALL);
    }
}
