//! What was found out about the nodes of a graph, kept so that it is found out once.

use std::any::{Any, TypeId};
use std::collections::HashMap;
use std::hash::Hash;
use std::sync::Arc;

/// Most answers of one kind; later ones are not kept.
const MOST: usize = 20_000;

/// Answers by the types of question and answer. A clone shares them until either learns more.
#[derive(Clone, Default)]
pub(crate) struct Facts {
    kinds: HashMap<TypeId, Arc<dyn Any + Send + Sync>>,
}

impl Facts {
    pub fn get<K, V>(&self, question: &K) -> Option<V>
    where
        K: Eq + Hash + Send + Sync + 'static,
        V: Clone + Send + Sync + 'static,
    {
        let kind = self.kinds.get(&TypeId::of::<(K, V)>())?;
        let answers: &HashMap<K, V> = kind.downcast_ref()?;
        answers.get(question).cloned()
    }

    pub fn insert<K, V>(&mut self, question: K, answer: V)
    where
        K: Clone + Eq + Hash + Send + Sync + 'static,
        V: Clone + Send + Sync + 'static,
    {
        let kind = TypeId::of::<(K, V)>();
        let known = self.kinds.remove(&kind);
        let known = known.and_then(|kind| kind.downcast::<HashMap<K, V>>().ok());
        let mut answers = known.unwrap_or_default();
        if answers.len() < MOST {
            Arc::make_mut(&mut answers).insert(question, answer);
        }
        self.kinds.insert(kind, answers);
    }
}
