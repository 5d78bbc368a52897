//! Which bodies touch, how deep and how hard, and which pass through each other.

use std::collections::{BTreeMap, BTreeSet};

use rapier3d_f64::parry::query;
use rapier3d_f64::prelude::{ColliderHandle, PairFilterContext, PhysicsHooks, SolverFlags};

use super::articulation::{from_pose, to_pose};
use super::{BodyId, RobotId, World, mark};
use crate::error::Result;

/// Two bodies that touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// The bodies, the one that came earlier into the world first.
    pub bodies: [BodyId; 2],
    /// How deep they overlap, in metres.
    pub depth: f64,
    /// With what force they push, in N.
    pub force: f64,
}

/// Pairs of bodies that pass through each other.
#[derive(Debug, Default)]
pub(super) struct Ignored(BTreeSet<(usize, usize)>);

impl Ignored {
    pub fn insert(&mut self, a: usize, b: usize) {
        self.0.insert((a.min(b), a.max(b)));
    }

    pub fn contains(&self, a: usize, b: usize) -> bool {
        self.0.contains(&(a.min(b), a.max(b)))
    }
}

impl PhysicsHooks for Ignored {
    fn filter_contact_pair(&self, context: &PairFilterContext) -> Option<SolverFlags> {
        let body = |collider: ColliderHandle| context.colliders[collider].user_data as usize;
        let ignored = self.contains(body(context.collider1), body(context.collider2));
        (!ignored).then_some(SolverFlags::default())
    }
}

impl World {
    /// Distance of two bodies' surfaces, in metres; negative by as much as they overlap.
    ///
    /// # Errors
    /// [`Error::Elsewhere`](crate::error::Error::Elsewhere).
    pub fn gap(&self, a: BodyId, b: BodyId) -> Result<f64> {
        self.check(a).and_then(|()| self.check(b))?;
        Ok(self.distance(a, b))
    }

    pub(crate) fn distance(&self, a: BodyId, b: BodyId) -> f64 {
        let (a, b) = (&self.bodies[a.0], &self.bodies[b.0]);
        let place = |record: &super::BodyRecord, collider: &super::Collider| {
            to_pose(&(from_pose(self.physics.bodies[record.carrier].position()) * collider.carrier_from_physical))
        };
        let mut least = f64::INFINITY;
        for collider_a in &a.colliders {
            let at_a = place(a, collider_a);
            for collider_b in &b.colliders {
                let (shape_a, shape_b) = (&*collider_a.physical, &*collider_b.physical);
                let at_b = place(b, collider_b);
                let overlap = query::contact(&at_a, shape_a, &at_b, shape_b, 0.0).ok().flatten();
                let distance =
                    || query::distance(&at_a, shape_a, &at_b, shape_b).map_or(f64::INFINITY, |found| found.distance);
                least = least.min(overlap.map_or_else(distance, |contact| contact.dist));
            }
        }
        least
    }

    /// All pairs that touch after the last step, in the order in which their bodies came into the world.
    #[must_use]
    pub fn contacts(&self) -> Vec<Contact> {
        self.contacts_where(|_, _| true)
    }

    /// Those of them in which a link of the robot touches anything that is none.
    ///
    /// # Errors
    /// [`Error::Elsewhere`](crate::error::Error::Elsewhere).
    pub fn contacts_of(&self, robot: RobotId) -> Result<Vec<Contact>> {
        self.robot(robot)?;
        Ok(self.contacts_with(robot))
    }

    pub(crate) fn contacts_with(&self, robot: RobotId) -> Vec<Contact> {
        self.contacts_where(|a, b| self.belongs_to(a, robot) != self.belongs_to(b, robot))
    }

    /// Two links of a robot that touch though they should not, if there are any.
    ///
    /// # Errors
    /// [`Error::Elsewhere`](crate::error::Error::Elsewhere).
    pub fn self_collision(&self, robot: RobotId) -> Result<Option<Contact>> {
        self.robot(robot)?;
        let both = self.contacts_where(|a, b| self.belongs_to(a, robot) && self.belongs_to(b, robot));
        Ok(both.into_iter().next())
    }

    /// Whether a body is a link of a robot; what is attached to one is not.
    ///
    /// # Errors
    /// [`Error::Elsewhere`](crate::error::Error::Elsewhere).
    pub fn is_link_of(&self, body: BodyId, robot: RobotId) -> Result<bool> {
        self.check(body)?;
        self.robot(robot)?;
        Ok(self.belongs_to(body, robot))
    }

    pub(crate) fn belongs_to(&self, body: BodyId, robot: RobotId) -> bool {
        self.bodies[body.0].robot == Some(robot)
    }

    fn id_at(&self, index: usize) -> BodyId {
        BodyId(index, mark(&self.bodies[index].name))
    }

    /// The touching pairs that are wanted; only for them the distance is computed.
    fn contacts_where(&self, wanted: impl Fn(BodyId, BodyId) -> bool) -> Vec<Contact> {
        let mut found: BTreeMap<[BodyId; 2], f64> = BTreeMap::new();
        for pair in self.physics.contact_pairs() {
            let body = |collider: ColliderHandle| self.id_at(self.physics.colliders[collider].user_data as usize);
            let (a, b) = (body(pair.collider1), body(pair.collider2));
            if self.ignored.contains(a.0, b.0) || !wanted(a, b) {
                continue;
            }
            *found.entry([a.min(b), a.max(b)]).or_default() += pair.total_impulse_magnitude() / self.options.step;
        }
        let touching = found.into_iter().filter_map(|(bodies, force)| {
            let gap = self.distance(bodies[0], bodies[1]);
            (gap <= 0.0).then_some(Contact { bodies, depth: -gap, force })
        });
        touching.collect()
    }
}
