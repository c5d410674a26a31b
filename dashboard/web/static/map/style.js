// How the tiles look. Layers of the Protomaps basemap have their own looks, those of other makers a plain one; names are
// drawn with the reader's own fonts: nothing is fetched.
const DARK = { earth: "#1d2226", water: "#16303f", green: "#1c2a22", built: "#2b3137", road: "#4a525a", major: "#6b737b", rail: "#4a525a", border: "#6d6580", ink: "#c9cfd4", halo: "#15181b" };
const LIGHT = { earth: "#f1f0ec", water: "#b9d7e8", green: "#dbe8d2", built: "#d9d4cc", road: "#ffffff", major: "#f6dca0", rail: "#b5b5b5", border: "#9b8fb0", ink: "#33383d", halo: "#ffffff" };
const GREEN = ["forest", "wood", "park", "grass", "grassland", "garden", "nature_reserve", "meadow", "scrub", "golf_course", "recreation_ground", "cemetery", "farmland"];
const KNOWN = new Set(["earth", "landcover", "landuse", "natural", "water", "roads", "buildings", "boundaries", "places", "pois", "transit"]);
const wide = (low, high) => ["interpolate", ["exponential", 1.6], ["zoom"], 8, low, 18, high, 24, high * 20];
const kind = (...kinds) => ["in", ["get", "kind"], ["literal", kinds]];
const area = ["==", ["geometry-type"], "Polygon"];

function vector(layers, look) {
  const has = new Set(layers), all = [];
  const add = (id, from, type, paint, more = {}) => has.has(from) && all.push({ id, source: "tiles", "source-layer": from, type, paint, ...more });
  add("earth", "earth", "fill", { "fill-color": look.earth });
  for (const from of ["landcover", "landuse", "natural"]) add(from, from, "fill", { "fill-color": look.green, "fill-opacity": 0.8 }, { filter: kind(...GREEN) });
  add("water", "water", "fill", { "fill-color": look.water }, { filter: area });
  add("streams", "water", "line", { "line-color": look.water, "line-width": wide(0.5, 3) }, { filter: ["!", area] });
  add("buildings", "buildings", "fill", { "fill-color": look.built });
  add("rail", "roads", "line", { "line-color": look.rail, "line-width": wide(0.4, 2), "line-dasharray": [3, 2] }, { filter: kind("rail") });
  add("small", "roads", "line", { "line-color": look.road, "line-width": wide(0.3, 5) }, { filter: ["!", kind("rail", "highway", "major_road")] });
  add("major", "roads", "line", { "line-color": look.major, "line-width": wide(0.8, 10) }, { filter: kind("highway", "major_road") });
  add("boundaries", "boundaries", "line", { "line-color": look.border, "line-width": 1, "line-dasharray": [4, 3] });
  for (const from of layers.filter((name) => !KNOWN.has(name))) {
    add(`${from} area`, from, "fill", { "fill-color": look.built, "fill-opacity": 0.35 }, { filter: area });
    add(`${from} line`, from, "line", { "line-color": look.major, "line-width": 1 });
    add(`${from} point`, from, "circle", { "circle-color": look.ink, "circle-radius": 2 }, { filter: ["==", ["geometry-type"], "Point"] });
  }
  const name = { "text-field": ["get", "name"], "text-size": 12, "text-font": ["sans-serif"] };
  const text = { "text-color": look.ink, "text-halo-color": look.halo, "text-halo-width": 1.4 };
  add("streets", "roads", "symbol", text, { layout: { ...name, "text-size": 11, "symbol-placement": "line" }, minzoom: 14 });
  add("places", "places", "symbol", text, { layout: { ...name, "text-size": 13 } });
  return all;
}

export function styleOf(info, url, dark) {
  const look = dark ? DARK : LIGHT, raster = info.kind === "raster";
  const ground = { id: "ground", type: "background", paint: { "background-color": raster || info.layers.includes("earth") ? look.halo : look.earth } };
  const dim = dark ? { "raster-brightness-max": 0.65, "raster-saturation": -0.3 } : {};
  const layers = raster ? [{ id: "tiles", type: "raster", source: "tiles", paint: dim }] : vector(info.layers, look);
  const source = raster ? { type: "raster", url, tileSize: 256 } : { type: "vector", url };
  return { version: 8, sources: { tiles: source }, layers: [ground, ...layers] };
}
