//! Application of a device: its function behind the EtherCAT controller.

use crate::al_status_code::AlStatusCode;
use crate::mailbox::Emergency;
use crate::object_dictionary::{Abort, Key, ObjectDictionary};

/// Application of a device: its function behind the EtherCAT controller. Process data reach it as objects of its
/// dictionary.
pub trait Application {
    /// Advances the application to the time `now` \[ns\].
    fn advance(&mut self, dictionary: &mut ObjectDictionary, now: u64);

    /// New output data are in the dictionary, in state OP, at SYNC0 or as they came. `now` is the time \[ns\].
    fn outputs(&mut self, dictionary: &mut ObjectDictionary, now: u64);

    /// Puts input data into the dictionary before they are read, in states SAFEOP and OP. `now` is the time \[ns\].
    fn inputs(&mut self, dictionary: &mut ObjectDictionary, now: u64);

    /// Puts outputs into their safe state, since the device left OP at `now` \[ns\]; `why` is the AL status code of
    /// an error, else `None`.
    fn outputs_are_lost(
        &mut self,
        dictionary: &mut ObjectDictionary,
        now: u64,
        why: Option<AlStatusCode>,
    );

    /// Reacts to an object that the main device has written by SDO.
    ///
    /// # Errors
    ///
    /// [`Abort`] if the value is refused; the object gets its old value back.
    fn written(&mut self, dictionary: &ObjectDictionary, key: Key) -> Result<(), Abort> {
        let _ = (dictionary, key);
        Ok(())
    }

    /// Next CoE emergency message to be sent; `None` if there is none.
    fn emergency(&mut self) -> Option<Emergency> {
        None
    }
}
