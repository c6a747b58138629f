//! Where an estimator stands, as bytes: what a study with other numbers goes on from.

use lynkeus::run::{Errors, Handover, HandoverRow, Standing};

use crate::bytes::{Parser, Writer};

pub(crate) fn save(from: &Handover, to: &mut Writer) {
    to.texts(from.signals.iter().map(String::as_str));
    to.word(from.rows.len() as u64);
    for row in &from.rows {
        to.number(row.t);
        to.numbers(&row.signals);
        to.word(u64::from(row.is_own));
    }
    to.word(u64::from(from.standing.is_some()));
    if let Some(standing) = &from.standing {
        save_standing(standing, to);
    }
}

pub(crate) fn load(from: &mut Parser<'_>) -> Option<Handover> {
    let signals = from.texts()?;
    let mut rows = vec![];
    for _ in 0..from.count(24)? {
        rows.push(HandoverRow {
            t: from.number()?,
            signals: from.numbers()?,
            is_own: from.word()? == 1,
        });
    }
    let standing = match from.word()? {
        0 => None,
        _ => Some(load_standing(from)?),
    };
    Some(Handover {
        standing,
        signals,
        rows,
    })
}

fn save_standing(from: &Standing, to: &mut Writer) {
    to.number(from.time);
    for named in [&from.inputs, &from.states, &from.estimates] {
        to.word(named.len() as u64);
        for (name, value) in named {
            to.bytes(name.as_bytes());
            to.number(*value);
        }
    }
    to.word(from.own as u64);
    match &from.errors {
        Errors::Unknown => to.word(0),
        Errors::Root(entries) => {
            to.word(1);
            to.numbers(entries);
        }
        Errors::Particles { x, log, round } => {
            to.word(2);
            to.numbers(x);
            to.numbers(log);
            to.word(*round);
        }
    }
}

fn load_standing(from: &mut Parser<'_>) -> Option<Standing> {
    let named = |from: &mut Parser<'_>| -> Option<Vec<(String, f64)>> {
        let count = from.count(16)?;
        let read = (0..count).map(|_| Some((from.text()?, from.number()?)));
        read.collect()
    };
    Some(Standing {
        time: from.number()?,
        inputs: named(from)?,
        states: named(from)?,
        estimates: named(from)?,
        own: usize::try_from(from.word()?).ok()?,
        errors: match from.word()? {
            0 => Errors::Unknown,
            1 => Errors::Root(from.numbers()?),
            2 => Errors::Particles {
                x: from.numbers()?,
                log: from.numbers()?,
                round: from.word()?,
            },
            _ => return None,
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_saved_is_loaded() {
        for (errors, has_begun) in [
            (Errors::Unknown, true),
            (Errors::Root(vec![1.0, 0.0, 2.0, 3.0]), true),
            (
                Errors::Particles {
                    x: vec![1.0, 2.0],
                    log: vec![-0.5],
                    round: 7,
                },
                true,
            ),
            (Errors::Unknown, false),
        ] {
            let named = |name: &str| vec![(name.to_owned(), 0.5)];
            let standing = Standing {
                time: 2.0,
                inputs: named("u"),
                states: named("x"),
                own: 1,
                errors,
                estimates: named("x_hat"),
            };
            let handover = Handover {
                standing: has_begun.then_some(standing),
                signals: vec!["y".into(), "u".into()],
                rows: vec![HandoverRow {
                    t: 3.0,
                    signals: vec![1.0, 2.0],
                    is_own: true,
                }],
            };
            let mut to = Writer::default();
            save(&handover, &mut to);
            assert_eq!(load(&mut Parser(&to.0)), Some(handover));
            for cut in 0..to.0.len() {
                assert_eq!(load(&mut Parser(&to.0[..cut])), None);
            }
        }
    }
}
