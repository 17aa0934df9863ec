"""Drops files onto a window as a file manager does (XDND 5): drop_file.py WINDOW FILE..."""
import sys
import time

from Xlib import X, Xatom, display
from Xlib.protocol import event


def drop(window_id, paths):
    connection = display.Display()
    screen = connection.screen()
    atom = connection.intern_atom
    source = screen.root.create_window(0, 0, 1, 1, 0, screen.root_depth)
    target = connection.create_resource_object("window", window_id)
    uris, selection = atom("text/uri-list"), atom("XdndSelection")
    source.set_selection_owner(selection, X.CurrentTime)

    def send(kind, *numbers):
        data = [source.id, *numbers] + [0] * (4 - len(numbers))
        message = event.ClientMessage(window=target, client_type=atom(kind), data=(32, data))
        target.send_event(message, event_mask=0)
        connection.flush()

    place = target.get_geometry()
    middle = target.translate_coords(screen.root, 0, 0)
    x, y = place.width * 2 // 3 - middle.x, place.height // 2 - middle.y
    send("XdndEnter", 5 << 24, uris)
    send("XdndPosition", 0, x << 16 | y, X.CurrentTime, atom("XdndActionCopy"))
    asked, deadline = False, time.monotonic() + 60
    while time.monotonic() < deadline:
        if not connection.pending_events():
            time.sleep(0.01)
            continue
        got = connection.next_event()
        if got.type == X.ClientMessage and got.client_type == atom("XdndStatus") and not asked:
            if not got.data[1][1] & 1:
                sys.exit("the window takes no files")
            asked = True
            send("XdndDrop", 0, X.CurrentTime)
        elif got.type == X.SelectionRequest:
            got.requestor.change_property(got.property, got.target, 8, "".join(f"file://{path}\r\n" for path in paths).encode())
            got.requestor.send_event(event.SelectionNotify(time=got.time, requestor=got.requestor, selection=got.selection,
                                                           target=got.target, property=got.property))
            connection.flush()
        elif got.type == X.ClientMessage and got.client_type == atom("XdndFinished"):
            return
    sys.exit("the window didn't take the file")


if __name__ == "__main__":
    drop(int(sys.argv[1]), sys.argv[2:])
