use super::*;
use crate::decay::Sector;
use lynkeus_expr::Interval;

/// x_i' = x_{i+1} − 2x_i + θ_i x_i, the last state without a next one.
fn chain(n: usize) -> ErrorModel {
    let mut constant = vec![vec![Interval::ZERO; n]; n];
    for (i, row) in constant.iter_mut().enumerate() {
        row[i] = Interval::point(-2.0);
        if i + 1 < n {
            row[i + 1] = Interval::ONE;
        }
    }
    let sector = |column: usize| {
        let mut direction = vec![Interval::ZERO; n];
        direction[column] = Interval::ONE;
        Sector {
            column,
            direction,
            range: Interval::new(-0.2, 0.2).unwrap(),
        }
    };
    ErrorModel {
        constant,
        sectors: (0..n).map(sector).collect(),
    }
}

/// What is found with few unknowns is a point of the problem with all of them.
#[test]
fn a_near_point_is_one_of_the_full_problem() {
    let n = 12;
    let models = [chain(n)];
    let request = Request {
        rate: 0.3,
        measured: vec![0],
        slopes: vec![1.0],
        noise: vec![1.0],
        scale: vec![1.0; n],
        aim: Aim::Noise,
        limit: None,
        budget: Budget::default(),
    };
    let scaled = Scaled::new(&models, &request);
    let near = scaled.inequalities(Extent::Near);
    let full = scaled.inequalities(Extent::Full);
    let found = near.normalised().unwrap();
    let same = full.like(&near, &found);
    assert_eq!(near.P.at(&found), full.P.at(&same));
    assert_eq!(full.P.at(&same)[(0, n - 1)], 0.0);
    assert_eq!(near.Y.at(&found), full.Y.at(&same));
    let mut problem = full.problem.clone();
    problem.minimise(&full.P.trace());
    assert!(problem.solve_from(&same).is_ok());
    assert!(near.bounded(WIDEST).has_inside().is_ok());
}

/// No gain on state 0 moves what it does not see.
#[test]
fn what_is_out_of_reach_is_seen_without_a_point() {
    let mut model = chain(12);
    model.constant[5][6] = Interval::ZERO;
    model.constant[11][11] = Interval::point(1.0);
    let mut request = Request {
        rate: 0.3,
        measured: vec![0],
        slopes: vec![1.0],
        noise: vec![1.0],
        scale: vec![1.0; 12],
        aim: Aim::Noise,
        limit: None,
        budget: Budget::default(),
    };
    assert!(!is_reachable(std::slice::from_ref(&model), &request, false));
    let scaled = Scaled::new(std::slice::from_ref(&model), &request);
    let full = scaled.inequalities(Extent::Full).bounded(WIDEST);
    assert_eq!(full.has_inside(), Err(Failure::Infeasible));
    model.constant[11][11] = Interval::point(-1.0);
    request.rate = 0.1;
    assert!(is_reachable(&[model], &request, true));
}
