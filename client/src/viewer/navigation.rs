//! How the camera is moved: by what a hand does, towards a goal that it reaches smoothly.
//!
//! The camera is a pivot, two angles and a distance, whatever it is moved by: turning around the pivot
//! (as CloudCompare and Potree do), looking around (which moves the pivot around the eye), walking,
//! panning, coming nearer to what is under the cursor. Every gesture changes the goal at once; what is
//! shown follows it, two thirds of the way in `FOLLOW_SECONDS`, and is the goal when no pixel is apart any
//! more. From then on nothing moves and nothing has to be drawn.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DVec2, DVec3};

use crate::camera::{Camera, Projection};

/// Time in which two thirds of the way to the goal are gone.
const FOLLOW_SECONDS: f64 = 0.06;

/// Parts of a view's height that are no movement any more.
const SETTLED: f64 = 2e-5;

/// Full vertical field of view of a camera that was never told another one.
pub const FOV_Y: f64 = 50.0 * PI / 180.0;

/// Nearer to straight up or down than this, z is no help to tell what is up.
const POLE: f64 = FRAC_PI_2 - 1e-3;

/// Part of the picture that what is framed may fill.
const FILLED: f64 = 0.96;

/// A turn of the wheel.
const WHEEL_STEP: f64 = 1.25;

/// Parts of a scene's size that are flown through in a second.
const FLY_SPEED: f64 = 0.12;

/// Where the camera is: looking at `pivot` from `distance` away.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// What is turned around, and looked at.
    pub pivot: DVec3,
    /// Heading of the view direction, counter-clockwise from +y (north), radians.
    pub yaw: f64,
    /// Rise of the view direction, -pi/2 (straight down) to pi/2.
    pub pitch: f64,
    /// From the eye to the pivot, world units.
    pub distance: f64,
    /// Full vertical field of view; in an orthographic view, that of the perspective one that
    /// shows the pivot as large.
    pub fov_y: f64,
    /// Whether the view is orthographic.
    pub orthographic: bool,
}

impl Pose {
    /// The pose that looks as a camera does; what it may be rolled is lost.
    #[must_use]
    pub fn of(camera: &Camera) -> Self {
        let basis = camera.basis();
        let forward = basis.forward;
        let pitch = forward.z.clamp(-1.0, 1.0).asin();
        // Straight up or down, what is up in the picture tells the heading.
        let heading = if pitch.abs() > POLE { basis.up * -pitch.signum() } else { forward };
        let yaw = (-heading.x).atan2(heading.y);
        let span = (camera.target - camera.eye).length();
        let (fov_y, distance, orthographic) = match camera.projection {
            Projection::Perspective { fov_y } => (fov_y, span, false),
            Projection::Orthographic { height } => {
                (FOV_Y, 0.5 * height / (0.5 * FOV_Y).tan(), true)
            }
        };
        let pivot = if orthographic { camera.target } else { camera.eye + forward * distance };
        Self { pivot, yaw, pitch, distance, fov_y, orthographic }
    }

    /// Into the picture.
    #[must_use]
    pub fn forward(&self) -> DVec3 {
        let (sin, cos) = self.yaw.sin_cos();
        let (rise, level) = self.pitch.sin_cos();
        DVec3::new(-sin * level, cos * level, rise)
    }

    /// To the upper edge of the picture.
    fn up(&self) -> DVec3 {
        let (sin, cos) = self.yaw.sin_cos();
        let (rise, level) = self.pitch.sin_cos();
        DVec3::new(sin * rise, -cos * rise, level)
    }

    fn right(&self) -> DVec3 {
        let (sin, cos) = self.yaw.sin_cos();
        DVec3::new(cos, sin, 0.0)
    }

    /// Where the camera stands.
    #[must_use]
    pub fn eye(&self) -> DVec3 {
        self.pivot - self.distance * self.forward()
    }

    /// World units from the lower to the upper edge of the picture, at the pivot.
    #[must_use]
    pub fn height(&self) -> f64 {
        2.0 * self.distance * (0.5 * self.fov_y).tan()
    }

    /// The camera. An orthographic one stands `behind` world units farther back than needed, so that
    /// what is near is not cut off.
    #[must_use]
    pub fn camera(&self, behind: f64) -> Camera {
        let projection = if self.orthographic {
            Projection::Orthographic { height: self.height() }
        } else {
            Projection::Perspective { fov_y: self.fov_y }
        };
        let back = if self.orthographic { self.distance.max(behind) } else { self.distance };
        let up = if self.pitch.abs() > POLE { self.up() } else { DVec3::Z };
        Camera { eye: self.pivot - back * self.forward(), target: self.pivot, up, projection }
    }

    /// Where on the plane through the pivot a place of the picture is; `at` counts heights of the picture
    /// to the right of its middle, and above it.
    #[must_use]
    pub fn on_pivot_plane(&self, at: DVec2) -> DVec3 {
        self.pivot + self.height() * (at.x * self.right() + at.y * self.up())
    }

    fn is_possible(&self) -> bool {
        self.camera(0.0).check().is_ok() && self.distance > 0.0
    }

    /// How far apart two poses are, as a part of the picture's height.
    fn apart(&self, other: &Self) -> f64 {
        let height = self.height().min(other.height());
        let turned = angle(self.yaw - other.yaw).abs().max((self.pitch - other.pitch).abs());
        let lens = (self.fov_y - other.fov_y).abs() / other.fov_y;
        (self.pivot - other.pivot).length() / height
            + turned / other.fov_y
            + (self.distance / other.distance).ln().abs()
            + lens
    }
}

/// The same angle between -pi and pi.
fn angle(radians: f64) -> f64 {
    (radians + PI).rem_euclid(TAU) - PI
}

/// The six fixed views.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// From the south, looking north.
    Front,
    /// From the north.
    Back,
    /// From the west.
    Left,
    /// From the east.
    Right,
    /// From above, north up.
    Top,
    /// From below.
    Bottom,
}

impl Side {
    /// All of them, with their names.
    pub const ALL: [(Self, &'static str); 6] = [
        (Self::Front, "Front"),
        (Self::Back, "Back"),
        (Self::Left, "Left"),
        (Self::Right, "Right"),
        (Self::Top, "Top"),
        (Self::Bottom, "Bottom"),
    ];

    const fn angles(self) -> (f64, f64) {
        match self {
            Self::Front => (0.0, 0.0),
            Self::Back => (PI, 0.0),
            Self::Left => (-FRAC_PI_2, 0.0),
            Self::Right => (FRAC_PI_2, 0.0),
            Self::Top => (0.0, -FRAC_PI_2),
            Self::Bottom => (0.0, FRAC_PI_2),
        }
    }
}

/// What a drag with the first button does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mode {
    /// Turn around the pivot.
    #[default]
    Orbit,
    /// Look around from the eye.
    Fly,
}

/// Which way to walk: right, ahead, up; each -1 to 1.
pub type Walk = DVec3;

/// The camera under a hand.
#[derive(Debug, Clone)]
pub struct Navigator {
    now: Pose,
    goal: Pose,
    /// What a drag does.
    pub mode: Mode,
    /// World units a second.
    speed: f64,
    /// Lowest and highest corner of what there is to see.
    extent: (DVec3, DVec3),
    /// Whether a hand or a file has chosen the view; until then new clouds may.
    is_chosen: bool,
}

impl Default for Navigator {
    fn default() -> Self {
        let camera = Camera::overview(DVec3::ZERO, DVec3::ONE, 1.5);
        let pose = Pose::of(&camera);
        let extent = (DVec3::ZERO, DVec3::ONE);
        Self { now: pose, goal: pose, mode: Mode::Orbit, speed: 0.3, extent, is_chosen: false }
    }
}

impl Navigator {
    /// What is shown.
    #[must_use]
    pub fn pose(&self) -> Pose {
        self.now
    }

    /// Where it will be.
    #[must_use]
    pub fn goal(&self) -> Pose {
        self.goal
    }

    /// The camera that is looked through now.
    #[must_use]
    pub fn camera(&self) -> Camera {
        self.now.camera(self.scene_size())
    }

    /// Whether the view was chosen by somebody.
    #[must_use]
    pub fn is_chosen(&self) -> bool {
        self.is_chosen
    }

    /// As if nobody had chosen a view.
    pub fn forget_choice(&mut self) {
        self.is_chosen = false;
    }

    /// World units that are flown in a second.
    #[must_use]
    pub fn speed(&self) -> f64 {
        self.speed
    }

    fn scene_size(&self) -> f64 {
        (self.extent.1 - self.extent.0).length().max(1e-9)
    }

    /// Tells what there is to see.
    pub fn set_extent(&mut self, min: DVec3, max: DVec3) {
        if (min, max) != self.extent && min.is_finite() && max.is_finite() {
            self.extent = (min, max);
            self.speed = FLY_SPEED * self.scene_size();
        }
    }

    /// Looks as a camera does, at once.
    pub fn jump(&mut self, camera: &Camera) {
        let pose = Pose::of(camera);
        if pose.is_possible() {
            (self.now, self.goal, self.is_chosen) = (pose, pose, true);
        }
    }

    /// Moves there smoothly.
    pub fn go(&mut self, camera: &Camera) {
        let pose = Pose::of(camera);
        if pose.is_possible() {
            (self.goal, self.is_chosen) = (pose, true);
            self.now.orthographic = pose.orthographic;
        }
    }

    /// Shows all of what there is, from where the view direction is now; `first` in the usual oblique
    /// one, at once.
    pub fn fit(&mut self, aspect: f64, first: bool) {
        let (min, max) = self.extent;
        if first {
            let pose = Pose::of(&Camera::overview(min, max, aspect));
            let orthographic = self.goal.orthographic;
            (self.now, self.goal) = (Pose { orthographic, ..pose }, Pose { orthographic, ..pose });
            return;
        }
        self.frame(min, max, aspect);
    }

    /// Shows all of a box, from where the view direction is now.
    pub fn frame(&mut self, min: DVec3, max: DVec3, aspect: f64) {
        let goal = &mut self.goal;
        goal.pivot = 0.5 * (min + max);
        let (right, up, forward) = (goal.right(), goal.up(), goal.forward());
        let half = 0.5 * (max - min);
        let tangent = FILLED * (0.5 * goal.fov_y).tan();
        // Each corner is inside the picture from that distance on.
        let needed = (0..8).map(|corner| {
            let sign = |axis: usize| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 };
            let at = half * DVec3::new(sign(0), sign(1), sign(2));
            let across = at.dot(up).abs().max(at.dot(right).abs() / aspect.max(1e-3));
            let depth = if goal.orthographic { 0.0 } else { at.dot(forward) };
            across / tangent - depth
        });
        let least = 1e-6 * (1.0 + goal.pivot.abs().max_element());
        goal.distance = needed.fold(least, f64::max);
        self.is_chosen = true;
    }

    /// One of the six views, of all that there is.
    pub fn look_from(&mut self, side: Side, aspect: f64) {
        (self.goal.yaw, self.goal.pitch) = side.angles();
        self.fit(aspect, false);
    }

    /// Perspective or orthographic.
    pub fn set_orthographic(&mut self, orthographic: bool) {
        self.now.orthographic = orthographic;
        self.goal.orthographic = orthographic;
        self.is_chosen = true;
    }

    /// Turns around the pivot, or looks around: parts of the picture's height that the hand moved, to the
    /// right and up.
    pub fn turn(&mut self, moved: DVec2) {
        self.is_chosen = true;
        match self.mode {
            Mode::Orbit => {
                self.goal.yaw -= moved.x * PI;
                self.goal.pitch = (self.goal.pitch - moved.y * PI).clamp(-FRAC_PI_2, FRAC_PI_2);
            }
            Mode::Fly => {
                // What is under the cursor stays there, about.
                let eye = self.goal.eye();
                self.goal.yaw += moved.x * self.goal.fov_y;
                let pitch = self.goal.pitch - moved.y * self.goal.fov_y;
                self.goal.pitch = pitch.clamp(-FRAC_PI_2, FRAC_PI_2);
                self.goal.pivot = eye + self.goal.distance * self.goal.forward();
            }
        }
    }

    /// Moves what is at the pivot with the hand: parts of the picture's height, to the right and up.
    pub fn pan(&mut self, moved: DVec2) {
        let goal = &mut self.goal;
        goal.pivot -= goal.height() * (moved.x * goal.right() + moved.y * goal.up());
        self.is_chosen = true;
    }

    /// Comes nearer (`steps` of the wheel above 0) to `anchor`, which stays where it is in the picture.
    pub fn zoom(&mut self, steps: f64, anchor: DVec3) {
        let before = self.goal;
        let factor = WHEEL_STEP.powf(-steps.clamp(-20.0, 20.0));
        let goal = &mut self.goal;
        goal.distance *= factor;
        goal.pivot = anchor + factor * (goal.pivot - anchor);
        let nearest = 1e-9 * (1.0 + anchor.abs().max_element());
        let farthest = 1e3 * (self.extent.1 - self.extent.0).length().max(1e-3)
            + (before.pivot - 0.5 * (self.extent.0 + self.extent.1)).length();
        let is_near_enough = goal.distance > nearest && goal.distance < farthest;
        if !(is_near_enough && goal.is_possible()) {
            *goal = before;
        }
        self.is_chosen = true;
    }

    /// Turns around another place from now on; the picture glides until it is in the middle.
    pub fn set_pivot(&mut self, pivot: DVec3) {
        let forward = self.goal.forward();
        let ahead = (pivot - self.goal.eye()).dot(forward);
        self.goal.pivot = pivot;
        if !self.goal.orthographic && ahead > 0.0 {
            self.goal.distance = ahead;
        }
        self.is_chosen = true;
    }

    /// Flies faster or slower by turns of the wheel.
    pub fn change_speed(&mut self, steps: f64) {
        let size = self.scene_size();
        let speed = self.speed * WHEEL_STEP.powf(steps);
        self.speed = speed.clamp(1e-6 * size, 10.0 * size);
    }

    /// Walks for some time.
    pub fn walk(&mut self, way: Walk, seconds: f64) {
        let least = 1e-6 * self.scene_size();
        let goal = &mut self.goal;
        let step = way.x * goal.right() + way.y * goal.forward() + way.z * DVec3::Z;
        goal.pivot += self.speed * seconds * step;
        if goal.orthographic {
            // Going ahead moves nothing in an orthographic view: it comes nearer instead.
            goal.distance = (goal.distance - way.y * self.speed * seconds).max(least);
        }
        self.is_chosen = true;
    }

    /// Whether what is shown is the goal.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.now == self.goal
    }

    /// Follows the goal for some time; returns whether there is more to go.
    pub fn follow(&mut self, seconds: f64) -> bool {
        if self.is_settled() {
            return false;
        }
        let share = 1.0 - (-seconds / FOLLOW_SECONDS).exp();
        let (now, goal) = (&mut self.now, &self.goal);
        now.orthographic = goal.orthographic;
        let eye = now.eye() + share * (goal.eye() - now.eye());
        now.yaw += share * angle(goal.yaw - now.yaw);
        now.pitch += share * (goal.pitch - now.pitch);
        now.fov_y += share * (goal.fov_y - now.fov_y);
        now.distance *= (goal.distance / now.distance).powf(share);
        match self.mode {
            Mode::Orbit => now.pivot += share * (goal.pivot - now.pivot),
            // The eye goes straight, not the pivot.
            Mode::Fly => now.pivot = eye + now.distance * now.forward(),
        }
        if now.apart(goal) < SETTLED || !now.is_possible() {
            self.now = self.goal;
        }
        !self.is_settled()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn scene() -> Navigator {
        let mut navigator = Navigator::default();
        navigator.set_extent(DVec3::new(500.0, 600.0, 10.0), DVec3::new(540.0, 620.0, 18.0));
        navigator.fit(1.5, true);
        navigator
    }

    fn settle(navigator: &mut Navigator) -> usize {
        (1..10_000).find(|_| !navigator.follow(0.016)).expect("comes to rest")
    }

    /// Parts of the picture's height right of the middle and above.
    fn seen_at(camera: &Camera, place: DVec3) -> DVec2 {
        let basis = camera.basis();
        let from_eye = place - camera.eye;
        let scale = camera.pixels_per_world(from_eye.dot(basis.forward), 1);
        scale * DVec2::new(from_eye.dot(basis.right), from_eye.dot(basis.up))
    }

    fn poses() -> impl Strategy<Value = Pose> {
        let pivot = prop::array::uniform3(-1e3..1e3).prop_map(DVec3::from_array);
        (pivot, -3.0..3.0, -FRAC_PI_2..FRAC_PI_2, 1e-3..1e5, 0.1..2.5, any::<bool>()).prop_map(
            |(pivot, yaw, pitch, distance, fov_y, orthographic)| {
                let fov_y = if orthographic { FOV_Y } else { fov_y };
                Pose { pivot, yaw, pitch, distance, fov_y, orthographic }
            },
        )
    }

    proptest! {
        #[test]
        fn a_pose_is_the_pose_of_its_camera(pose in poses()) {
            let camera = pose.camera(0.0);
            prop_assert!(camera.check().is_ok());
            let again = Pose::of(&camera);
            prop_assert!(again.apart(&pose) < 1e-4, "{again:?} {pose:?}");
        }

        #[test]
        fn what_is_under_the_cursor_stays_there_while_zooming(
            pose in poses(), at in prop::array::uniform2(-0.5..0.5), steps in -5.0..5.0,
        ) {
            let mut navigator = scene();
            navigator.jump(&pose.camera(0.0));
            let pose = navigator.goal();
            let at = DVec2::from_array(at);
            let anchor = pose.on_pivot_plane(at);
            navigator.zoom(steps, anchor);
            let after = seen_at(&navigator.goal().camera(0.0), anchor);
            prop_assert!((after - at).length() < 1e-6, "{after} {at}");
        }
    }

    #[test]
    fn every_movement_comes_to_rest_at_its_goal_and_stays_there() {
        let mut navigator = scene();
        navigator.turn(DVec2::new(0.3, -0.1));
        navigator.zoom(3.0, navigator.goal().pivot);
        navigator.pan(DVec2::new(0.1, 0.2));
        let frames = settle(&mut navigator);
        assert!(frames < 120, "{frames} frames");
        assert_eq!(navigator.pose(), navigator.goal());
        assert!(!navigator.follow(0.016), "nothing moves at rest");
    }

    #[test]
    fn the_six_views_look_where_they_say_and_hold_everything() {
        for (side, name) in Side::ALL {
            for orthographic in [false, true] {
                let mut navigator = scene();
                navigator.set_orthographic(orthographic);
                navigator.look_from(side, 1.5);
                settle(&mut navigator);
                let camera = navigator.camera();
                camera.check().expect("possible");
                let forward = camera.basis().forward;
                let expected = match side {
                    Side::Front => DVec3::Y,
                    Side::Back => DVec3::NEG_Y,
                    Side::Left => DVec3::X,
                    Side::Right => DVec3::NEG_X,
                    Side::Top => DVec3::NEG_Z,
                    Side::Bottom => DVec3::Z,
                };
                assert!((forward - expected).length() < 1e-9, "{name}: {forward}");
                if side == Side::Top {
                    assert!((camera.basis().up - DVec3::Y).length() < 1e-9, "north is up");
                }
                for corner in 0..8 {
                    let pick = |axis: usize| {
                        if corner >> axis & 1 == 1 {
                            navigator.extent.1[axis]
                        } else {
                            navigator.extent.0[axis]
                        }
                    };
                    let at = seen_at(&camera, DVec3::new(pick(0), pick(1), pick(2)));
                    assert!(at.x.abs() <= 0.75 && at.y.abs() <= 0.5, "{name}: {at}");
                }
            }
        }
    }

    #[test]
    fn orthographic_and_perspective_show_the_pivot_equally_large() {
        let mut navigator = scene();
        let near_pivot = navigator.goal().pivot + DVec3::new(0.5, 0.0, 0.0);
        let before = seen_at(&navigator.camera(), near_pivot);
        navigator.set_orthographic(true);
        let after = seen_at(&navigator.camera(), near_pivot);
        assert!((after - before).length() < 0.01, "{before} {after}");
    }

    #[test]
    fn looking_around_leaves_the_eye_where_it_is_and_walking_moves_it() {
        let mut navigator = scene();
        navigator.mode = Mode::Fly;
        let eye = navigator.goal().eye();
        navigator.turn(DVec2::new(0.4, 0.1));
        assert!((navigator.goal().eye() - eye).length() < 1e-9);
        let forward = navigator.goal().forward();
        navigator.walk(DVec3::Y, 0.5);
        let walked = navigator.goal().eye() - eye;
        assert!((walked - 0.5 * navigator.speed() * forward).length() < 1e-9);
        settle(&mut navigator);
    }

    #[test]
    fn the_pivot_can_be_any_place_and_the_camera_then_turns_around_it() {
        let mut navigator = scene();
        let place = DVec3::new(510.0, 612.0, 12.0);
        navigator.set_pivot(place);
        navigator.turn(DVec2::new(0.2, 0.2));
        settle(&mut navigator);
        assert!(seen_at(&navigator.camera(), place).length() < 1e-6);
    }

    #[test]
    fn no_amount_of_wheel_leads_to_an_impossible_camera() {
        for steps in [5.0, -5.0] {
            let mut navigator = scene();
            for _ in 0..200 {
                navigator.zoom(steps, navigator.goal().pivot);
                navigator.camera().check().expect("possible");
                navigator.goal().camera(0.0).check().expect("possible");
            }
        }
    }
}
