//! The plane in which initial states are dragged.

use scrnn::analysis::principal_components::PrincipalComponents;

/// A plane in the space of initial states.
pub struct Plane {
    pub mean: Vec<f64>,
    pub axes: [Vec<f64>; 2],
    /// Of each learned state, along the two axes.
    pub points: Vec<[f64; 2]>,
    /// What it is.
    pub label: &'static str,
    /// What dragging changes.
    pub about: &'static str,
}

impl Plane {
    /// Through the first `count` of all states: that of their first two components. Where they have none, one that goes through them, and
    /// along the units that the outputs listen to most, by `influence`. None for a single unit.
    pub fn of(states: &[f64], count: usize, influence: &[f64]) -> Option<Self> {
        let units = influence.len();
        if units < 2 || count == 0 {
            return None;
        }
        let all = states.len() / units;
        let state = |s: usize| &states[s * units..(s + 1) * units];
        let mean_of = |count: usize, i: usize| (0..count).map(|s| state(s)[i]).sum::<f64>() / count as f64;
        if let Some(components) = PrincipalComponents::of(states, units).filter(|_| count >= 3) {
            let coordinates = components.first(2);
            let mean: Vec<f64> = (0..units).map(|i| mean_of(all, i)).collect();
            // What a step along a component is in the space of states: the regression of the states on it.
            let axis = |component: usize| -> Vec<f64> {
                let along: Vec<f64> = coordinates.iter().skip(component).step_by(2).copied().collect();
                let length = along.iter().map(|a| a * a).sum::<f64>();
                let of = |i: usize| along.iter().enumerate().map(|(s, a)| a * (state(s)[i] - mean[i])).sum::<f64>();
                (0..units).map(|i| if length > 0.0 { of(i) / length } else { 0.0 }).collect()
            };
            return Some(Self {
                axes: [axis(0), axis(1)],
                mean,
                points: (0..count).map(|s| [coordinates[2 * s], coordinates[2 * s + 1]]).collect(),
                label: "initial states: first component across, second up",
                about: "In places between the learned states only the first two components change.",
            });
        }
        let mut order: Vec<usize> = (0..units).collect();
        order.sort_by(|&a, &b| influence[b].total_cmp(&influence[a]));
        let along = |i: usize| (0..units).map(|k| f64::from(u8::from(k == i))).collect::<Vec<f64>>();
        let mean: Vec<f64> = (0..units).map(|i| mean_of(count, i)).collect();
        let way: Vec<f64> = (0..units).map(|i| state(count - 1)[i] - state(0)[i]).collect();
        let length = way.iter().map(|x| x * x).sum::<f64>().sqrt();
        let (axes, label, about) = if length > 0.0 {
            let first: Vec<f64> = way.iter().map(|x| x / length).collect();
            // Of two units one at least does not lie along the way between the states.
            let i = order.into_iter().find(|&i| first[i].abs() < 0.9)?;
            let mut second = along(i);
            second.iter_mut().zip(&first).for_each(|(a, b)| *a -= first[i] * b);
            let size = second.iter().map(|x| x * x).sum::<f64>().sqrt();
            second.iter_mut().for_each(|a| *a /= size);
            let label = "initial states: across, between the two; up, one unit";
            (
                [first, second],
                label,
                "Two states have a line, and no plane: up and down one context unit changes besides.",
            )
        } else {
            let label = "initial state: across and up, the two strongest units";
            (
                [along(order[0]), along(order[1])],
                label,
                "There is one learned state: its two strongest context units change.",
            )
        };
        let points = (0..count).map(|s| {
            let off = state(s).iter().zip(&mean).map(|(u, mean)| u - mean).collect::<Vec<f64>>();
            // What rounding leaves is no extent that anything could be drawn along.
            let along = [0, 1].map(|k| axes[k].iter().zip(&off).map(|(a, u)| a * u).sum::<f64>());
            along.map(|place| if place.abs() < 1e-9 { 0.0 } else { place })
        });
        Some(Self { points: points.collect(), mean, axes, label, about })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The learned states lie where the plane has them.
    fn leads_back(plane: &Plane, states: &[f64]) {
        for (s, point) in plane.points.iter().enumerate() {
            let units = plane.mean.len();
            for (i, u) in states[s * units..(s + 1) * units].iter().enumerate() {
                let found = plane.mean[i] + point[0] * plane.axes[0][i] + point[1] * plane.axes[1][i];
                assert!((found - u).abs() < 1e-12, "state {s}, unit {i}: {found}, not {u}");
            }
        }
    }

    #[test]
    fn one_or_two_states_have_a_plane_too_and_a_single_unit_has_none() {
        let influence = [0.1, 2.0, 1.0];
        for rows in [&[&[0.5, -0.2, 0.1][..]][..], &[&[0.5, -0.2, 0.1], &[0.5, 0.4, 0.1]], &[&[1.0; 3], &[1.0; 3]]] {
            let states = rows.concat();
            let plane = Plane::of(&states, rows.len(), &influence).unwrap();
            leads_back(&plane, &states);
            assert!(plane.points.iter().all(|point| point[1] == 0.0), "{:?}", plane.points);
            let dot =
                |a: usize, b: usize| -> f64 { plane.axes[a].iter().zip(&plane.axes[b]).map(|(x, y)| x * y).sum() };
            assert!((dot(0, 0) - 1.0).abs() < 1e-12 && (dot(1, 1) - 1.0).abs() < 1e-12 && dot(0, 1).abs() < 1e-12);
        }
        // The difference lies along the strongest unit: up goes the next.
        let plane = Plane::of(&[0.0, -1.0, 0.0, 0.0, 1.0, 0.0], 2, &influence).unwrap();
        assert_eq!((plane.axes[0][1], plane.axes[1][2]), (1.0, 1.0));
        assert!(Plane::of(&[0.5, 0.6], 2, &[1.0]).is_none());
    }
}
