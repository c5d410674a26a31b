// Tiles of one PMTiles file, drawn by MapLibre GL JS below our own canvas. Loaded when there is such a file only.
import { styleOf } from "/static/map/style.js";

const HOME = "/static/vendor";
const PIXEL_MS = 30_000; // in which MapLibre has to come up
const fileOf = (info) => new URL(`/api/map/tiles?state=${info.tag}`, location.href).href; // cached bytes are of this state
let library = null;

function script(src) {
  return new Promise((resolve, reject) => {
    const element = document.createElement("script");
    Object.assign(element, { src, onload: resolve, onerror: () => reject(new Error(`${src} did not load`)) });
    document.head.append(element);
  });
}

async function load(file) {
  const [gl] = await Promise.all([import(`${HOME}/maplibre/maplibre-gl.mjs`), script(`${HOME}/pmtiles/pmtiles.js`)]);
  gl.setWorkerUrl(`${HOME}/maplibre/maplibre-gl-worker.mjs`);
  const protocol = new window.pmtiles.Protocol();
  protocol.add(new window.pmtiles.PMTiles(file));
  gl.addProtocol("pmtiles", protocol.tile);
  return gl;
}

export function hasWebgl() {
  try {
    return Boolean(document.createElement("canvas").getContext("webgl2"));
  } catch {
    return false;
  }
}

export class Tiles {
  // say(text): what a person should know when tiles do not come.
  static async on(root, info, dark, say) {
    const gl = await (library ??= load(fileOf(info)));
    const tiles = new Tiles();
    tiles.info = info;
    tiles.map = new gl.Map({
      container: root, style: styleOf(info, `pmtiles://${fileOf(info)}`, dark), interactive: false, attributionControl: false,
      maxZoom: 24, fadeDuration: 0, renderWorldCopies: false,
    });
    tiles.map.on("error", ({ error }) => say(`Tiles do not come: ${error?.message ?? "no reason given"}`));
    await new Promise((resolve, reject) => {
      tiles.map.once("load", resolve);
      setTimeout(() => reject(new Error("the tiles' renderer did not come up")), PIXEL_MS);
    });
    return tiles;
  }

  look(camera) { this.map.jumpTo({ center: camera.center, zoom: camera.zoom }); }

  resize() { this.map.resize(); }

  theme(dark) { this.map.setStyle(styleOf(this.info, `pmtiles://${fileOf(this.info)}`, dark)); }
}
