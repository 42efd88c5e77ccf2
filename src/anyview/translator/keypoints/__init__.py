"""A translator whose code is a list of places: where things are, not what the whole picture is like.

Enc finds keypoints: the mean places under softmaxes over maps (Finn et al. 2016), with what is seen there and
along the lines from each to the next. T tells from the expert's keypoints, now and in the first frame, where
those of the target's first frame go, and takes from the expert what an arm looks like. Dec draws that in
layers that masks blend (Ebert et al. 2017): the target's first frame, so that whatever stands still is
copied; the same carried along by the object, the tool and the forearm (Siarohin et al. 2019), so that these
stay as sharp as they were; the colour of each keypoint and line; for the rest what a network draws from
Gaussians at the keypoints (Jakab et al. 2018, Kulkarni et al. 2019) and along the lines.

Same methods as those of ``network.ContextTranslator``, with one encoder for the expert and for the context.
"""
