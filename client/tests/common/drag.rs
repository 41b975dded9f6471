//! Another program on the screen, out of which things are dragged onto the window (XDND, version 5).

use std::time::{Duration, Instant};

use x11rb::{
    CURRENT_TIME, atom_manager,
    connection::Connection,
    protocol::{
        Event,
        xproto::{
            AtomEnum, ClientMessageEvent, ConnectionExt, CreateWindowAux, EventMask, PropMode,
            SELECTION_NOTIFY_EVENT, SelectionNotifyEvent, WindowClass,
        },
    },
    rust_connection::RustConnection,
    wrapper::ConnectionExt as _,
};

const PATIENCE: Duration = Duration::from_secs(60);

const VERSION: u32 = 5;

atom_manager! {
    Atoms: AtomsCookie {
        XdndEnter,
        XdndPosition,
        XdndStatus,
        XdndDrop,
        XdndFinished,
        XdndLeave,
        XdndSelection,
        XdndActionCopy,
        UriList: b"text/uri-list",
        Text: b"text/plain",
    }
}

/// What is dragged.
#[derive(Debug, Clone, Copy)]
pub enum Kind {
    Files,
    Text,
}

pub struct Dragger {
    connection: RustConnection,
    atoms: Atoms,
    own: u32,
    target: u32,
}

impl Dragger {
    /// Onto the program's window on that display.
    pub fn new(display: &str) -> Self {
        let (connection, screen) = RustConnection::connect(Some(display)).expect("the screen");
        let root = connection.setup().roots[screen].root;
        let atoms =
            Atoms::new(&connection).map(|cookie| cookie.reply()).expect("the screen answers");
        let atoms = atoms.expect("names");
        let own = connection.generate_id().expect("a number");
        let aux = CreateWindowAux::new();
        let class = WindowClass::INPUT_ONLY;
        connection.create_window(0, own, root, 0, 0, 1, 1, 0, class, 0, &aux).expect("a window");
        let tree = connection.query_tree(root).expect("sent").reply().expect("windows");
        let is_it = |window: &u32| {
            let (name, string) = (AtomEnum::WM_NAME, AtomEnum::STRING);
            let name = connection.get_property(false, *window, name, string, 0, 64).expect("sent");
            name.reply().is_ok_and(|name| name.value == b"lodestream")
        };
        let target = tree.children.into_iter().find(is_it).expect("the program's window");
        Self { connection, atoms, own, target }
    }

    fn tell(&self, what: u32, data: [u32; 4]) {
        let [a, b, c, d] = data;
        let message = ClientMessageEvent::new(32, self.target, what, [self.own, a, b, c, d]);
        self.connection
            .send_event(false, self.target, EventMask::NO_EVENT, message)
            .expect("the screen");
        self.connection.flush().expect("the screen");
    }

    /// Drags something over the window: whether it would be taken.
    pub fn hover(&self, kind: Kind, what: &str) -> bool {
        let name = match kind {
            Kind::Files => self.atoms.UriList,
            Kind::Text => self.atoms.Text,
        };
        let selection = self.atoms.XdndSelection;
        let owned = self.connection.set_selection_owner(self.own, selection, CURRENT_TIME);
        owned.expect("the screen").check().expect("it is ours");
        self.tell(self.atoms.XdndEnter, [VERSION << 24, name, 0, 0]);
        self.tell(
            self.atoms.XdndPosition,
            [0, 100 << 16 | 100, CURRENT_TIME, self.atoms.XdndActionCopy],
        );
        self.answer(self.atoms.XdndStatus, what) & 1 == 1
    }

    /// Lets go of what is over the window.
    pub fn drop(&self) {
        self.tell(self.atoms.XdndDrop, [0, CURRENT_TIME, 0, 0]);
        self.answer(self.atoms.XdndFinished, "");
    }

    /// Takes it away again.
    pub fn leave(&self) {
        self.tell(self.atoms.XdndLeave, [0; 4]);
    }

    /// Waits for the window's answer, the second word of it; hands `what` over where it is asked for.
    fn answer(&self, name: u32, what: &str) -> u32 {
        let end = Instant::now() + PATIENCE;
        loop {
            assert!(Instant::now() < end, "the window does not answer to what is dragged");
            match self.connection.poll_for_event().expect("the screen") {
                Some(Event::ClientMessage(message)) if message.type_ == name => {
                    return message.data.as_data32()[1];
                }
                Some(Event::SelectionRequest(asked)) => {
                    let (window, place) = (asked.requestor, asked.property);
                    self.connection
                        .change_property8(
                            PropMode::REPLACE,
                            window,
                            place,
                            asked.target,
                            what.as_bytes(),
                        )
                        .expect("the screen");
                    let told = SelectionNotifyEvent {
                        response_type: SELECTION_NOTIFY_EVENT,
                        sequence: 0,
                        time: asked.time,
                        requestor: window,
                        selection: asked.selection,
                        target: asked.target,
                        property: place,
                    };
                    self.connection
                        .send_event(false, window, EventMask::NO_EVENT, told)
                        .expect("the screen");
                    self.connection.flush().expect("the screen");
                }
                Some(_) => {}
                None => std::thread::sleep(Duration::from_millis(5)),
            }
        }
    }
}
