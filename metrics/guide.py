"""What every metric means, for those who read a score and did not write it: shown on the command line and on pages.

Beside the definition stand the two scores that a reader needs to judge another one by: a perfect renderer's (the exact
picture with the technique's own filter and shutter) and a point sampler's (one sample, at each pixel's centre, at one
instant). Figures are closed forms, which the tests compute anew.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

# What the formulas are written in; pages print it once, above them.
NOTATION: Mapping[str, str] = MappingProxyType(
    {
        "T, R": "luminance of the picture under test, and of the exact picture with the same pixel filter and shutter",
        "C": "contrast that the scene declares, white minus black: the unit of all errors",
        "E": "error (T − R) / C of a pixel; p counts pixels, t frames and s seeds",
        "Ê, T̂, f": "Fourier transforms over the number of values; frames a second",
    }
)


@dataclass(frozen=True, slots=True)
class Guide:
    """What a reader needs to know of one metric; whole sentences but for the formula.

    Attributes
    ----------
    meaning : str
        In one sentence.
    formula : str
        In the letters of `NOTATION`.
    perfect, point_sampled : str
        What a perfect renderer and a point-sampling one score.
    caution : str
        What it cannot tell, and what else moves it.
    """

    meaning: str
    formula: str
    perfect: str
    point_sampled: str
    caution: str


GUIDE: Mapping[str, Guide] = MappingProxyType(
    {
        "rmse": Guide(
            "How far the picture is from the truth, whatever the artifact: the root mean square of the error.",
            "RMSE = √( mean E² )",
            "Zero.",
            "0.289 (1/√12) over the pixels that an edge along the rows crosses and 0 over the others.",
            "It tells neither stairs from noise nor a still error from a flickering one, and an empty background "
            "lowers it.",
        ),
        "psnr": Guide(
            "The RMS error on a logarithmic scale: 20 dB more are a tenth of the error.",
            "PSNR = −20 log₁₀ RMSE",
            "No number, as the error is 0: the status is identical.",
            "10.8 dB if an edge crosses every pixel, 30.8 dB if it crosses one in a hundred.",
            "It ranks pictures as rmse does and no better. Its peak is the declared contrast, not the brightest pixel "
            "or 255.",
        ),
        "relmse": Guide(
            "The mean square error relative to the brightness of the truth, so that shadows count as much as lights.",
            "relMSE = mean (T − R)² / (R² + 0.01 C²)",
            "Zero.",
            "0.473 over the pixels that an edge between black and white crosses.",
            "It has no upper end: one bright pixel where black should be can outweigh all the others.",
        ),
        "max_error": Guide(
            "The error of the worst pixel.",
            "max |E|",
            "Zero.",
            "Up to 0.5 along straight edges, up to 1 where something smaller than a pixel is hit or missed.",
            "One pixel decides, and more pixels find worse ones. The extras have its place and the 99.9th percentile.",
        ),
        "ssim": Guide(
            "How alike the structure of picture and truth is in small windows, from 1 for identical down to −1.",
            "SSIM = mean [ (2 μ_T μ_R + c₁)(2 σ_TR + c₂) ] / [ (μ_T² + μ_R² + c₁)(σ_T² + σ_R² + c₂) ]; "
            "c₁ = (0.01 C)², c₂ = (0.03 C)²",
            "One.",
            "There is no closed form: above 0.9 where the picture is a few edges, near 0 where fine detail comes back "
            "as a false pattern.",
            "Even areas are judged harshly: noise of 0.03 of the contrast on plain grey halves it. It looks at the "
            "first, middle and last frame, so it cannot see flicker.",
        ),
        "jaggies": Guide(
            "How ragged a straight edge is: the standard deviation of the distance between where the picture and the "
            "truth have it.",
            "J_std = std of r(x) along the edge, r(x) = Σ_y E(x, y) in pixels",
            "0, with any filter.",
            "0.289 px (1/√12) on irrational slopes, √((1 − 1/q²)/12) px on a slope of p/q (0.25 px on 1/2), and 0 "
            "along the rows.",
            "Noise is ragged too: one random sample a pixel scores 0.408 px without a single stair (see jaggies_str). "
            "A shift of the whole edge is jaggies_bias, and blur does not show at all.",
        ),
        "jaggies_rms": Guide(
            "How far the drawn edge is from the true line, raggedness and shift together.",
            "J_rms = √( mean r² ) = √( J_std² + J_bias² )",
            "0, with any filter.",
            "0.289 px on irrational slopes, anything from 0 to 0.5 px along the rows.",
            "Along the rows it depends on where the edge happens to lie in its pixel, and says nothing of stairs.",
        ),
        "jaggies_bias": Guide(
            "How far the edge is displaced as a whole, positive towards larger y (down), or larger x of steep edges.",
            "J_bias = mean of r(x) along the edge",
            "0, with any filter.",
            "0 on irrational slopes, within ±1/(2q) px on a slope of p/q, within ±0.5 px along the rows.",
            "Stairs cancel in it. A picture that is too bright by e looks displaced by e for every pixel across the "
            "measured strip.",
        ),
        "jaggies_str": Guide(
            "The part of the raggedness that repeats with each pixel row the edge crosses: stairs, without the noise.",
            "J_str² = mean square of r's projection on cos 2πkφ and sin 2πkφ, k = 1 … 8, less the noise's share; "
            "φ(x) = frac(m (x + ½) + b) of the edge y = m x + b",
            "0, with any filter.",
            "0.278 px on irrational slopes; random samples, as noisy as they are, score about 0.",
            "It carries the sign of its square, as noise alone falls on both sides of 0. It needs 32 columns, and an "
            "edge along the rows has no stairs.",
        ),
        "shimmer": Guide(
            "How strongly the error changes from frame to frame: what buzzes, flickers and crawls.",
            "SH_err = √( mean_p Var_t E )",
            "0, however the scene moves.",
            "0.0721 for one upright edge that passes 16 columns in steps of 1/32 px, 0.707 for a pattern of one line "
            "a pixel that moves: the whole picture flashes.",
            "Stairs that crawl along an edge put over 0.9 of their RMSE into it. Noise counts in full where every "
            "frame has new seeds, and not at all on a still scene with fixed ones. Its square and that of the still "
            "error add up to rmse².",
        ),
        "shimmer_abs": Guide(
            "What flickers faster under a pan than anything the pixels can show: detail finer than the pixels that "
            "came through.",
            "SH_abs = √( Σ mean_p |T̂(n)|² ) / C over temporal frequencies |n| > (|a| + |b|) / 2 cycles a frame, "
            "for a pan of (a, b) px a frame",
            "A property of the filter, not 0. Of 17/16 lines a pixel the box leaves 0.0413, the tent 0.0024, the "
            "Gaussian of σ = 0.5 px 0.0027; of less than half a line a pixel any filter leaves 0.",
            "0.707 at 17/16 lines a pixel.",
            "Blur lowers it as well as a good filter does. It needs a declared pan of less than a pixel a frame, and "
            "a whole loop of it (the status is windowed otherwise).",
        ),
        "buzz": Guide(
            "The kind of the flicker: near 0 it crawls slowly, 1 is like noise, at 2 it alternates with every frame.",
            "buzz = mean (E[t+1] − E[t])² / (2 SH_err²), the last frame being followed by the first",
            "No number, as nothing flickers: the status is undefined_no_shimmer.",
            "0.182 on an edge that takes 32 frames a pixel, about 6/n at n frames: slow edges crawl.",
            "It says nothing of how much flicker there is: read it beside shimmer. Independent noise of N frames "
            "scores N/(N − 1).",
        ),
        "flux_flicker": Guide(
            "How much the picture's total light comes and goes, which in small moving things is seen as blinking.",
            "std_t( Σ_p T ) / mean_t( Σ_p T )",
            "0 with a box or a tent; a thin line leaves 0.0123 under the usual Gaussian (σ = 0.5 px, cut at 1.5 px).",
            "√((1 − w)/w) for a line w px wide: 3 at a width of 0.1 px, 1.73 at 0.25 px, 1 at 0.5 px.",
            "Light that truly changes, or leaves the picture, counts as well. Many small things average out, and a "
            "bright background hides them.",
        ),
        "moire": Guide(
            "How much of the error is a slow pattern, of four pixels a period or more: moiré, as the eye sees it.",
            "M = √( Σ |Ê(ν)|² over 0 < |ν| ≤ ¼ cycle a pixel )",
            "Zero: a beat between two real patterns is in the reference too, and does not count.",
            "0.748 at 17/16 lines a pixel, seen as waves of 16 px. A 4 x 4 grid of samples scores 0.0052 there, and "
            "0.714 at 65/16: the ghost has only moved.",
            "All errors have some low frequencies: still stairs put 0.3 to 0.7 of their RMSE into it, white noise "
            "0.44. Lines of a declared grating are left out.",
        ),
        "moire_peak": Guide(
            "How strong the strongest false wave is; its period and direction are in the extras.",
            "P = 2 max |Ê(ν)| over 0 < |ν| ≤ ¼ cycle a pixel",
            "Zero.",
            "1.06 at 17/16 lines a pixel: a full wave of 16 px where there should be next to none.",
            "Noise has a strongest wave as well, 0.042 of its deviation at 128 x 128. Rings and receding patterns have "
            "no single one: the extras have the peaks of blocks.",
        ),
        "strobing": Guide(
            "How much of a pattern that turns, or passes, is seen at a false speed: what is still visible of all that "
            "moves too fast for the frame rate.",
            "STROBE_abs = √( Σ |c_m|² / Σ |a_m|² ), above over orders m with |m r| ≥ f/2, below over all but 0; "
            "c_m of the picture, a_m of the sharp pattern, at r rev/s; of a grating that passes, its harmonics",
            "A property of the shutter, not 0: three blades at 29 rev/s and 30 frames a second score 1 at an instant, "
            "0.196 with the shutter open for half a frame, 0.032 for a whole one.",
            "1 where every order is too fast, 0.315 for three blades at 1 rev/s, whose sharp borders are.",
            "Blur of any kind lowers it. Few passes do not: three equally spaced ones show three blades at 30 rev/s "
            "sharp and still, a score of 1.",
        ),
        "strobing_err": Guide(
            "How far a pattern that turns, or passes, is from what the same shutter shows exactly.",
            "STROBE_err = √( Σ mean_t |c_m(T) − c_m(R)|² / Σ |a_m|² ) over orders m ≠ 0",
            "0, with any shutter.",
            "0.969 for three blades at 29 rev/s where the shutter is open for a whole frame and almost nothing should "
            "be left of them.",
            "It counts errors in the annulus of the rotor alone, and noise and ragged borders among them.",
        ),
        "apparent_rate": Guide(
            "How fast the blades seem to turn, true or not; negative is backwards.",
            "r_seen = −arg( Σ_t c_B(t+1) c_B(t)* ) f / (2πB) for B blades; in theory wrap(B r) / B, wrapped into ±f/2",
            "The same as a point sampler: an exact picture has no other directions. Blur only makes them faint.",
            "Three blades at 30 frames a second: +1 at 1 rev/s, −1 at 29 rev/s, 0 at 30 rev/s.",
            "It reads the lowest order, however faint: strobing says how visible it is. At half a blade's spacing a "
            "frame there is no direction.",
        ),
        "noise": Guide(
            "How much the picture changes with the random seed.",
            "noise = √( mean over pixels and frames of Var_s T ) / C",
            "Zero.",
            "0, as a pixel's centre is not random. A random sample in each pixel scores 0.408 (1/√6) along an edge, "
            "16 jittered ones 0.051.",
            "A renderer without randomness scores 0 however wrong it is. noise² and structure² add up to rmse².",
        ),
        "structure": Guide(
            "The error that all seeds share: stairs, moiré and other patterns that no averaging takes away.",
            "structure² = mean ( Ē² − s²/S ), Ē and s² the mean and the variance of E over S seeds",
            "Zero.",
            "Its whole error, so the same as rmse; independent random samples score about 0.",
            "It carries the sign of its square, as an estimate from few seeds falls on both sides of 0.",
        ),
        "bias": Guide(
            "The mean error with its sign: light that is lost or added however many samples are averaged.",
            "bias = mean E over seeds, frames and pixels",
            "Zero.",
            "About 0 over many edges, whose bright and dark errors cancel.",
            "Cancelling hides errors: the extras have it for each tenth of the coverage. There an adaptive sampler "
            "that counts its 4 pilot samples with 12 others is off by 0.060 at a coverage of 0.2.",
        ),
        "mtf50": Guide(
            "How fine detail may be before it has lost half its contrast: sharpness, in cycles a pixel.",
            "MTF(MTF50) = ½, MTF = |Fourier transform of the slope of the edge's profile|",
            "A property of the filter: along the rows 0.603 with a box, 0.443 with a tent, 0.375 with a Gaussian of "
            "σ = 0.5 px.",
            "No number, as its MTF is 1 at all frequencies: the status is undefined_no_crossing.",
            "More is not better by itself, as point sampling is the sharpest of all: read it beside shimmer_abs, "
            "strobing and moire.",
        ),
        "edge_width": Guide(
            "How wide the ramp of an edge is, from 10 % to 90 % of the way.",
            "distance across the edge between 10 % and 90 % of its profile, in pixels",
            "A property of the filter: along the rows 0.8 px with a box, 1.11 px with a tent, 1.28 px with a Gaussian "
            "of σ = 0.5 px.",
            "No number, as the profile is a step: the status is below_resolution.",
            "Less is not better by itself, as point sampling has the steepest edges of all: read it beside jaggies and "
            "shimmer.",
        ),
        "flip": Guide(
            "How different the two pictures look to someone who flips between them on a display, from 0 to 1.",
            "mean FLIP(T, R), after Andersson et al. 2020",
            "Zero.",
            "There is no closed form; between a black and a white picture it is 0.967.",
            "It depends on the distance and the display that are assumed (in the extras), and sees key frames alone: "
            "no flicker.",
        ),
        "cvvdp": Guide(
            "How much worse the sequence looks than the truth, in just-objectionable differences below 10.",
            "ColorVideoVDP(T, R) in JOD, after Mantiuk et al. 2024",
            "Ten.",
            "There is no closed form; where one picture is 1 JOD better, three of four viewers prefer it.",
            "It depends on the display and the distance that are assumed (in the extras), and comes with the optional "
            "extra perceptual.",
        ),
        "spatial": Guide(
            "The error that would be there in a still picture: that of the instant in the middle of the shutter.",
            "spatial = RMS( T_c − R_0 ) / C, both at the shutter's middle: the technique, and the truth",
            "Zero.",
            "Its rmse at an instant: 0.289 over the pixels that an edge along the rows crosses.",
            "It has the technique's samples all at one time, so it is not what a moving picture shows.",
        ),
        "temporal": Guide(
            "The error that motion adds to the still one, as a square with its sign: strobing, lost or noisy blur.",
            "temporal = MSE(T − R_s) − spatial², R_s exact with the scene's shutter",
            "Zero.",
            "0 with an instantaneous shutter; else about the square of shutter blur it does not draw.",
            "Blur hides spatial errors, so that it is often negative: the moving picture is then better than the "
            "still one.",
        ),
        "shutter": Guide(
            "How far the scene's own shutter is from one that is open for the whole frame: strobing that is meant.",
            "shutter = RMS( R_s − R_1 ) / C, both exact: the scene's shutter, and one open for a whole frame",
            "The same for every technique of that filter.",
            "The same for every technique of that filter.",
            "It belongs to the scene and ranks no renderer.",
        ),
        "apparent_velocity": Guide(
            "How fast a regular pattern seems to move, true or not, in pixels a frame along its frequency.",
            "v_seen = wrap(ν v) / |wrap(ν)| for ν cycles a pixel that move by v px a frame; wrap(x) = x − round(x)",
            "The same as a point sampler: an exact picture has no other directions. Blur only makes them faint.",
            "−1 px a frame for a pattern of four pixels a period that moves by 3.",
            "Patterns finer than two pixels a period are seen as coarser ones, which move at speeds of their own.",
        ),
        "gaps": Guide(
            "How many pixels of a frame are as dark as if nothing were there, where the truth stands out.",
            "pixels a frame with R > R_min + C/8 and T < R_min + C/256, R_min the darkest of the frame",
            "Zero.",
            "0.375 for every pixel along an edge, so 0.75 along a line, whatever its width from 1/8 px on.",
            "It counts what is missing and not what is too bright, and a trace of light in a pixel is enough for it. "
            "Stairs have gaps as well, where an edge covers less than half of a pixel.",
        ),
    }
)
