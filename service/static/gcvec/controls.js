/** Pan and zoom by mouse, fingers and keys. */

const KEY_STEP = 60; // CSS pixels
const KEYS = {
  ArrowLeft: (view) => view.pan(KEY_STEP, 0),
  ArrowRight: (view) => view.pan(-KEY_STEP, 0),
  ArrowUp: (view) => view.pan(0, KEY_STEP),
  ArrowDown: (view) => view.pan(0, -KEY_STEP),
  "+": (view) => view.zoom(1.25),
  "=": (view) => view.zoom(1.25),
  "-": (view) => view.zoom(0.8),
  0: (view) => view.fit(),
};

/** Let mouse, fingers and keys move what a view shows. */
export function listen(view, signal) {
  const { canvas } = view;
  const fingers = new Map();
  canvas.style.touchAction = "none";
  if (!canvas.hasAttribute("tabindex")) canvas.tabIndex = 0;

  const on = (name, handler, options) => canvas.addEventListener(name, handler, { signal, ...options });
  const place = (event) => {
    const box = canvas.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  };
  const middle = () => {
    const all = [...fingers.values()];
    const x = all.reduce((sum, p) => sum + p.x, 0) / all.length;
    const y = all.reduce((sum, p) => sum + p.y, 0) / all.length;
    const spread = all.length > 1 ? Math.hypot(all[0].x - all[1].x, all[0].y - all[1].y) : 0;
    return { x, y, spread };
  };

  on("pointerdown", (event) => {
    if (event.button) return;
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, place(event));
  });
  on("pointermove", (event) => {
    if (!fingers.has(event.pointerId)) return;
    const before = middle();
    fingers.set(event.pointerId, place(event));
    const after = middle();
    view.pan(after.x - before.x, after.y - before.y);
    if (before.spread && after.spread) view.zoom(after.spread / before.spread, after.x, after.y);
  });
  for (const name of ["pointerup", "pointercancel"]) on(name, (event) => fingers.delete(event.pointerId));
  on(
    "wheel",
    (event) => {
      event.preventDefault();
      const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 24 : 1;
      const { x, y } = place(event);
      // Pinching on a touchpad arrives as a wheel with the control key, in smaller steps.
      view.zoom(Math.exp(-event.deltaY * lines * (event.ctrlKey ? 0.01 : 0.002)), x, y);
    },
    { passive: false },
  );
  on("dblclick", (event) => {
    const { x, y } = place(event);
    view.zoom(event.shiftKey ? 0.5 : 2, x, y);
  });
  on("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || !KEYS[event.key]) return;
    event.preventDefault();
    KEYS[event.key](view);
  });
}
