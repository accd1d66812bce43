use lazygrid_sim::Model;

/// Columns that share a plot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColumnGroup {
    pub name: &'static str,
    pub axis: &'static str,
    /// Indices in a row; see [`names`](lazygrid_sim::series::names).
    pub columns: Vec<usize>,
}

/// Separates arrivals, which grow, from momentary counts inside or bound.
pub fn groups(model: &Model) -> [ColumnGroup; 5] {
    let species = model.species.len();
    let reactions = species + model.reactions.len() + model.decays.len();
    let (mut arrivals, mut inside) = (Vec::new(), Vec::new());
    let mut column = reactions;
    for receiver in &model.receivers {
        for _ in (0..species).filter(|&k| receiver.counts(k)) {
            if receiver.kind.absorbs() { &mut arrivals } else { &mut inside }.push(column);
            column += 1;
        }
    }
    let group = |name, axis, columns| ColumnGroup { name, axis, columns };
    [
        group("particles", "particles", (0..species).collect()),
        group("reactions", "reactions so far", (species..reactions).collect()),
        group("arrivals", "arrived so far", arrivals),
        group("inside", "inside or bound", inside),
        group("pairs", "in the last step", vec![column, column + 1]),
    ]
}

pub fn column_of(model: &Model, receiver: usize, species: usize) -> Option<usize> {
    let species_of = |at: usize| (0..model.species.len()).filter(move |&k| model.receivers[at].counts(k));
    let before = (0..receiver).map(|at| species_of(at).count()).sum::<usize>();
    let first = model.species.len() + model.reactions.len() + model.decays.len();
    species_of(receiver).position(|known| known == species).map(|position| first + before + position)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lazygrid_sim::{Receiver, ReceiverKind, Species};

    #[test]
    fn counts_are_grouped_by_kind() {
        let receiver = |name: &str, kind, sees: [bool; 2]| Receiver {
            name: name.into(),
            kind,
            sees: sees.to_vec(),
            ..Receiver::default()
        };
        let species = ["A", "B"].map(|name| Species { name: name.into(), ..Species::default() });
        let model = Model {
            species: species.to_vec(),
            receivers: vec![
                receiver("a", ReceiverKind::Transparent, [true, true]),
                receiver("b", ReceiverKind::Reflecting, [true, true]),
                receiver("c", ReceiverKind::Absorbing, [false, true]),
                receiver("d", ReceiverKind::Transparent, [true, false]),
            ],
            ..Model::default()
        };
        let names = lazygrid_sim::series::names(&model);
        let shown =
            groups(&model).map(|group| group.columns.iter().map(|&k| &names[k][..]).collect::<Vec<_>>());
        let expected =
            [vec!["A", "B"], vec![], vec!["c:B"], vec!["a:A", "a:B", "d:A"], vec!["pairs", "contacts"]];
        assert_eq!(shown, expected);
        assert_eq!(
            [(0, 1), (1, 0), (2, 0), (2, 1), (3, 0)].map(|(r, s)| column_of(&model, r, s)),
            [Some(3), None, None, Some(4), Some(5)]
        );
    }
}
