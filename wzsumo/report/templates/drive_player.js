(() => {
  const drive = JSON.parse(document.getElementById("drive-data").textContent);
  const find = id => document.getElementById(id);
  const canvas = find("player"), pen = canvas.getContext("2d"), slider = find("at"), button = find("play"), now = find("now");
  const last = drive.ego.length - 1, WIDTHS = { edge: 0.15, lane: 0.15, centre: 0.3, stop: 0.6 };  // m
  slider.max = last;
  let playing = false, at = drive.zone_frame, before = 0, colours = {}, scale = 1;

  // Lane lines are 10 ft long with gaps of 30 ft (MUTCD 11th ed., Section 3A.04). The road shown is 160 m long on a wide screen and no less than 60 m on a narrow one; a metre is as long across as along.
  const fit = () => {
    const width = canvas.clientWidth, height = width < 600 ? 150 : 230, ratio = window.devicePixelRatio || 1;
    canvas.style.height = `${height}px`;
    canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio);
    scale = canvas.width / Math.max(60, Math.min(160, width / 7));
    const style = getComputedStyle(document.documentElement);
    for (const name of ["ground", "pavement", "drivable", "closed", "line", "centre", "device", "ego", "other", "brake", "trail"])
      colours[name] = style.getPropertyValue(`--${name}`).trim() || "#888";
  };
  const between = (a, b, share) => a.map((value, i) => {
    if (i === 2) return value + share * Math.atan2(Math.sin(b[2] - value), Math.cos(b[2] - value));
    return i < 3 || i === 6 ? value + share * (b[i] - value) : value;
  });
  const vehicle = (x, y, heading, length, width, colour, filled, braking) => {
    pen.save(); pen.translate(x, y); pen.rotate(heading);
    pen.fillStyle = filled ? colour : colours.ground; pen.fillRect(-length / 2, -width / 2, length, width);
    pen.strokeStyle = colour; pen.lineWidth = 0.25; pen.strokeRect(-length / 2, -width / 2, length, width);
    pen.beginPath(); pen.moveTo(length / 2 - 1.2, -width / 2); pen.lineTo(length / 2 - 0.2, 0); pen.lineTo(length / 2 - 1.2, width / 2); pen.stroke();
    if (braking) { pen.fillStyle = colours.brake; pen.fillRect(-length / 2 - 0.5, -width / 2, 0.7, width); }
    pen.restore();
  };
  const fill = (rings, colour) => {
    pen.fillStyle = colour;
    for (const ring of rings) { pen.beginPath(); ring.forEach(([x, y]) => pen.lineTo(x, y)); pen.fill(); }
  };
  const stroke = (points, colour, width, dashes) => {
    pen.strokeStyle = colour; pen.lineWidth = width; pen.setLineDash(dashes); pen.beginPath();
    points.forEach(([x, y]) => pen.lineTo(x, y)); pen.stroke(); pen.setLineDash([]);
  };
  const draw = () => {
    const frame = Math.max(0, Math.min(Math.floor(at), last - 1)), share = at - frame;
    const ego = between(drive.ego[frame], drive.ego[frame + 1], share);
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.fillStyle = colours.ground; pen.fillRect(0, 0, canvas.width, canvas.height);
    pen.translate(canvas.width * 0.4, canvas.height / 2); pen.scale(scale, -scale); pen.rotate(-ego[2]); pen.translate(-ego[0], -ego[1]);
    fill(drive.areas.pavement, colours.pavement); fill(drive.areas.drivable, colours.drivable); fill(drive.areas.closed_area, colours.closed);
    for (const line of drive.lines)
      stroke(line.points, line.kind === "centre" ? colours.centre : colours.line, WIDTHS[line.kind], line.kind === "lane" ? [3.05, 9.14] : []);
    stroke([...drive.ego.slice(0, frame + 1), ego], colours.trail, 0.4, []);
    pen.fillStyle = colours.device;
    for (const [x, y, radius] of drive.devices) { pen.beginPath(); pen.arc(x, y, Math.max(radius, 0.35), 0, 7); pen.fill(); }
    const next = new Map(drive.others[frame + 1].map(other => [other[3], other]));
    for (const other of drive.others[frame]) {
      const [x, y, heading, , length, width] = next.has(other[3]) ? between(other, next.get(other[3]), share) : other;
      vehicle(x, y, heading, length, width, colours.other, false, other[6]);
    }
    vehicle(ego[0], ego[1], ego[2], drive.size[0], drive.size[1], colours.ego, true, drive.ego[frame][4]);
    const seconds = at * drive.frame_s, why = drive.slowed.find(([from, to]) => from <= seconds && seconds <= to);
    const words = `${seconds.toFixed(1)} s, ${drive.ego[frame][3].toFixed(1)} m/s${why ? `, held back by ${why[2]}` : ""}`;
    now.textContent = words; slider.value = at; slider.setAttribute("aria-valuetext", words);
  };
  const go = to => { at = Math.max(0, Math.min(to, last)); draw(); };
  const step = time => {
    if (!playing) return;
    go(at + Number(find("rate").value) * (time - before) / 1000 / drive.frame_s); before = time;
    if (at >= last) { playing = false; button.textContent = "Play again"; } else requestAnimationFrame(step);
  };
  const toggle = () => {
    playing = !playing; button.textContent = playing ? "Pause" : "Play";
    if (at >= last) at = drive.zone_frame;
    if (playing) { before = performance.now(); requestAnimationFrame(step); }
  };
  button.onclick = toggle;
  slider.oninput = () => go(Number(slider.value));
  const second = 1 / drive.frame_s;
  const keys = { " ": toggle, ArrowLeft: () => go(at - second), ArrowRight: () => go(at + second), Home: () => go(drive.zone_frame), End: () => go(last) };
  canvas.addEventListener("keydown", event => {
    if (!keys[event.key] || event.ctrlKey || event.altKey || event.metaKey) return;
    keys[event.key](); event.preventDefault();
  });
  const refit = () => { fit(); draw(); };
  window.addEventListener("resize", refit);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", refit);
  refit();
})();
